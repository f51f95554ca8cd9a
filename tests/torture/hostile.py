"""Hostile files at the entries: what is changed at random is read, or refused in one line, in bounded time.

MAT files are not among them: they are read in a process of their own, half a second each.
"""

from __future__ import annotations

import random
import shutil
import struct
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import TYPE_CHECKING

import h5py  # type: ignore[import-untyped] # idem
import numpy as np
import openpyxl  # type: ignore[import-untyped] # ships no types
import pyarrow as pa
from pyarrow import parquet
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from bags.foreign.importing import import_streams
from bags.foreign.mapping import load_mapping, mapping_of
from bags.foreign.outline import describe_source
from bags.golden import golden_path
from bags.mcap.check import check
from bags.mcap.errors import BagError
from bags.runs.reader import read_run
from bags.sources.recorded import open_recorded
from bags.study import load_study
from bags.tables.export import export
from bags.tables.table_format import TableFormat
from bags.watch.scenarios import load_scenario
from dcmg.errors import CommandError
from dcmg.shipped import scenario_path
from dgu_sim.attacks.request import parse_parameters
from dgu_sim.errors import DguSimError
from monitor.errors import MonitorError
from tests.torture.outcome import Outcome

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

JUDGED_SEC = 10.0
_REFUSED = (BagError, CommandError, DguSimError, MonitorError)
_MAPPING = """
sampling_period_sec: 0.01
sampling: {policy: nearest, tolerance: 0.4}
time: {field: t, unit: s}
streams:
  - {link: 1-2, y: [V, I, {field: W, scale: 0.001, offset: 1.0}]}
"""
_TOKENS = (
    b"",
    b"\0",
    b"nan",
    b"-inf",
    b"1e999",
    b"9" * 5000,
    b"[" * 3000,
    b"{a: " * 200,
    b"&a [*a, *a]",
    b"*a",
    b"!!python/object/apply:os.getcwd []",
    b"\xed\xa0\x80",
    b"\xff\xfe",
    b"\xe2\x80\xae",
    b"../../..",
    b"/etc/passwd",
    b"=1+1",
    b"[/nope]",
    b"\r\n",
    b"\t",
    b";",
    b"x" * 70_000,
    b"0x1F",
    b"~",
    b"true",
    b"1979-05-27T07:32:00Z",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One way into the product.

    Attributes:
        original: a sound file, or a folder of some.
        file: which file of a folder is changed; "" for the original itself.
        read: takes the path of the changed one, and an empty folder.
    """

    original: Path
    read: Callable[[Path, Path], object]
    file: str = ""


def hostile(seed: int, folder: Path) -> Outcome:
    """Change one file of one entry, read it, and judge."""
    rng = random.Random(seed)  # noqa: S311 - no secret
    every = entries()
    name = [*every][seed % len(every)]
    entry = every[name]
    there, work = folder / f"hostile_{seed}{entry.original.suffix}", folder / f"work_{seed}"
    (shutil.copytree if entry.original.is_dir() else shutil.copy)(entry.original, there)
    work.mkdir()
    victim = there / entry.file if entry.file else there
    changed, what = changes(rng, victim.read_bytes())
    victim.write_bytes(changed)
    broken, note = [], "read"
    begin = time.monotonic()
    try:
        entry.read(there, work)
    except _REFUSED as error:
        note = "refused"
        if len(str(error).splitlines()) != 1:
            broken = [f"{len(str(error).splitlines())} lines: {error}"]
    except Exception as error:  # noqa: BLE001 - anything else is the finding
        broken = [f"{type(error).__name__}: {error}"[:500]]
    seconds = time.monotonic() - begin
    broken += [f"took {seconds:.0f} s"] if seconds > JUDGED_SEC else []
    for one in (there, work):
        (shutil.rmtree if one.is_dir() else Path.unlink)(one)
    return Outcome(
        kind="entries", seed=seed, what=f"{name}: {what}", row=name, broken=tuple(broken), seconds=seconds, note=note
    )


def changes(rng: random.Random, data: bytes) -> tuple[bytes, str]:
    """One to three changes."""
    said = []
    for _ in range(rng.choice((1, 1, 2, 3))):
        at = rng.randrange(len(data) + 1)
        end = min(len(data), at + rng.choice((1, 2, 8, 40, 400)))
        way = rng.choice(("flip", "cut", "drop", "double", "token", "token", "token", "line"))
        match way:
            case "flip" if at < len(data):
                data = data[:at] + bytes([data[at] ^ (1 << rng.randrange(8))]) + data[at + 1 :]
            case "cut":
                data = data[:at]
            case "drop":
                data = data[:at] + data[end:]
            case "double":
                data = data[:end] + data[at:]
            case "line":
                lines = data.split(b"\n")
                rng.shuffle(lines)
                data = b"\n".join(lines)
            case _:
                data = data[:at] + rng.choice(_TOKENS) + data[at if rng.random() < 0.5 else end :]
        said.append(f"{way} at {at}")
    return data, ", ".join(said)


@cache
def entries() -> Mapping[str, Entry]:
    """Each entry with a sound file, for the time of this process."""
    folder = Path(mkdtemp(prefix="dcmg_entries_"))
    t = 0.01 * np.arange(40)
    columns = {"t": t, "V": 48.0 + np.sin(t), "I": 5.0 + np.cos(t), "W": 1000.0 * t}
    tables = {
        "csv": _csv,
        "parquet": lambda path, table: parquet.write_table(pa.table(table), path),
        "xlsx": _xlsx,
        "h5": _h5,
    }
    studies = scenario_path("gallo_six_dgu").parents[1] / "studies"
    found = {
        "scenario": Entry(original=scenario_path("gallo_six_dgu_combined"), read=lambda path, _: load_scenario(path)),
        "study": Entry(original=studies / "unseen_attacks.yaml", read=lambda path, _: load_study(path)),
        "mapping": Entry(original=_text(folder / "mapping.yaml", _MAPPING), read=lambda path, _: load_mapping(path)),
        "parameters": Entry(
            original=_text(folder / "parameters.json", '{"bias": [0.1, 0.2, 0.3], "name": "x", "deep": {"a": [1]}}'),
            read=lambda path, _: parse_parameters(path.read_bytes().decode("utf-8", "surrogateescape")),
        ),
        "metadata.yaml": Entry(original=golden_path("biased"), file="metadata.yaml", read=_bag),
        "mcap": Entry(original=_recorded(folder / "mcap", StoragePlugin.MCAP), file="mcap.mcap", read=_bag),
        "run": Entry(original=golden_path("biased"), file="biased_0.mcap", read=lambda path, _: read_run(path)),
        "sqlite3": Entry(original=_recorded(folder / "db3", StoragePlugin.SQLITE3), file="db3.db3", read=_bag),
    }
    _ulog(folder / "log.ulg", columns)
    found["ulog"] = Entry(original=folder / "log.ulg", read=_log)
    for suffix, write in tables.items():
        write(folder / f"table.{suffix}", columns)
        found[suffix] = Entry(original=folder / f"table.{suffix}", read=_table)
    return found


def _text(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def _csv(path: Path, table: Mapping[str, np.ndarray]) -> None:
    rows = zip(*(column.tolist() for column in table.values()), strict=True)
    path.write_text("\n".join([",".join(table), *(",".join(map(repr, row)) for row in rows)]) + "\n")


def _xlsx(path: Path, table: Mapping[str, np.ndarray]) -> None:
    book = openpyxl.Workbook()
    for row in ([*table], *zip(*(column.tolist() for column in table.values()), strict=True)):
        book.active.append(row)
    book.save(path)


def _h5(path: Path, table: Mapping[str, np.ndarray]) -> None:
    with h5py.File(path, "w") as out:
        for name, values in table.items():
            out[name] = values


def _ulog(path: Path, table: Mapping[str, np.ndarray]) -> None:
    """One topic, by the published format of PX4's logs."""

    def message(kind: bytes, content: bytes) -> bytes:
        return struct.pack("<H", len(content)) + kind + content

    names = [name for name in table if name != "t"]
    out = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + message(b"B", bytes(40))
    out += message(b"F", f"sample:uint64_t timestamp;{''.join(f'double {name};' for name in names)}".encode())
    out += message(b"A", struct.pack("<BH", 0, 0) + b"sample")
    for stamp, *row in zip(table["t"].tolist(), *(table[name].tolist() for name in names), strict=True):
        out += message(b"D", struct.pack(f"<HQ{len(row)}d", 0, round(1e6 * stamp), *row))
    path.write_bytes(out)


def _recorded(path: Path, storage: StoragePlugin) -> Path:
    """Two topics by another library: text and numbers."""
    store = get_typestore(Stores.ROS2_JAZZY)
    with Writer(path, version=9, storage_plugin=storage) as writer:
        for topic, kind, make in (
            ("/words", "std_msgs/msg/String", lambda number: {"data": f"word {number}"}),
            ("/number", "std_msgs/msg/Float64", lambda number: {"data": 0.5 * number}),
        ):
            connection = writer.add_connection(topic, kind, typestore=store)
            for number in range(30):
                message = store.types[kind](**make(number))
                writer.write(connection, number * 1_000_000, store.serialize_cdr(message, kind))
    return path


def _bag(path: Path, work: Path) -> None:
    if next(path.glob("*.mcap"), None):
        check(path)
    with open_recorded(path) as recorded:
        for channel, _, data in recorded.messages(recorded.channels):
            decoder = recorded.decoders[channel]
            if not isinstance(decoder, str):
                try:
                    decoder.read(data)
                except BagError:
                    continue
    export(path, work / "tables", TableFormat.CSV)


def _table(path: Path, work: Path) -> None:
    _imported(path, work, {"time": {"field": "t"}, "streams": [{"link": "1-2", "y": ["V", "I", "W"]}]})


def _log(path: Path, work: Path) -> None:
    _imported(path, work, {"streams": [{"link": "1-2", "y": ["/sample.V", "/sample.I", "/sample.W"]}]})


def _imported(path: Path, work: Path, mapping: Mapping[str, object]) -> None:
    describe_source(path)
    import_streams(path, mapping_of(mapping, "test"), work / "bag")
