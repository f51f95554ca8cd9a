"""Kept cells of a study: damaged, swapped and misplaced ones are computed again, and that is said."""

from collections.abc import Callable
from pathlib import Path

import pyarrow as pa
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pyarrow import parquet

from bags.study import LocalPool, StudyCell, run_study
from bags.study.evaluate import SCHEMA
from bags.study.parts import Parts, as_part
from tests.bags.study.trees import bytes_of


def _flip(path: Path, at: int, bit: int = 0) -> None:
    data = bytearray(path.read_bytes())
    data[at % len(data)] ^= 1 << bit
    path.write_bytes(data)


def _folder(path: Path) -> None:
    path.unlink()
    path.mkdir()
    (path / "mine").write_text("kept")


DAMAGES: tuple[tuple[str, Callable[[Path, Path], object]], ...] = (
    ("check sum", lambda one, _: _flip(one, one.stat().st_size // 3)),
    ("check sum", lambda one, _: one.write_bytes(one.read_bytes()[:-100])),
    ("check sum", lambda one, _: one.write_bytes(b"")),
    ("no file", lambda one, _: _folder(one)),
    ("another cell", lambda one, other: one.write_bytes(other.read_bytes())),
)


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with one part, of made-up rows."""
    folder = tmp_path_factory.mktemp("parts")
    Parts(folder, SCHEMA).write("one", as_part("one", _rows(range(7))))
    return folder


def _rows(seeds: range) -> pa.Table:
    columns = {field.name: [None] * len(seeds) for field in SCHEMA} | {"seed": list(seeds)}
    return pa.table(columns, schema=SCHEMA)


def test_damaged_parts_are_computed_again_and_said(cells: tuple[StudyCell, ...], tmp_path: Path) -> None:
    """The table of a study in a folder with damaged parts is the same, byte for byte, and each one is named."""
    table = run_study(cells, tmp_path, LocalPool(2))
    sound, paths = bytes_of(table), [tmp_path / "parts" / f"{one.key}.parquet" for one in cells]
    for reason, damage in DAMAGES:
        damage(*paths)
        said: list[str] = []
        run_study(cells, tmp_path, LocalPool(2), say=said.append)
        assert [str(paths[0]) in line and reason in line for line in said] == [True], (reason, said)
        assert bytes_of(table) == sound, reason
    (aside,) = (tmp_path / "parts").glob("*.set_aside_*")
    assert (aside / "mine").read_text() == "kept"


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(at=st.integers(0, 1 << 20), bit=st.integers(0, 7))
def test_every_bit_of_a_part_counts(finished: Path, tmp_path: Path, at: int, bit: int) -> None:
    """No flipped bit gives other rows."""
    damaged = Parts(tmp_path, SCHEMA)
    damaged.path("one").write_bytes((finished / "one.parquet").read_bytes())
    _flip(damaged.path("one"), at, bit)
    assert damaged.read("one") == "does not agree with its check sum"


def test_a_part_is_an_ordinary_parquet_file(finished: Path) -> None:
    """Anybody can read it, and what is read back are its rows."""
    assert parquet.read_table(finished / "one.parquet")["seed"].to_pylist() == [*range(7)]
    found = Parts(finished, SCHEMA).read("one")
    assert isinstance(found, pa.Table)
    assert found.equals(_rows(range(7)))
