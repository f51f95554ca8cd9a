"""Studies on Dask: real schedulers and workers on loopback, some of them killed."""

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from dask import config

from bags.study import LocalPool, StudyCell, StudyError, cells_of, load_study, run_study
from bags.study.cluster import DaskPool, _versions, dask_pool
from dcmg.shipped import scenario_path
from tests.bags.study.trees import bytes_of

_MOST_SEC = 250.0
_OURS = "--host 127.0.0.1 --no-dashboard"


@pytest.fixture(name="short")
def _short(cells: tuple[StudyCell, ...]) -> tuple[StudyCell, ...]:
    """Eight cells of one seed each."""
    return tuple(replace(one, seeds=(seed,)) for one in cells for seed in (1, 2, 3, 4))


@pytest.fixture(name="pool", scope="module")
def _pool() -> Iterator[DaskPool]:
    with dask_pool("local:2") as pool:
        yield pool


@pytest.fixture(name="started")
def _started() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Start programs that end with the test."""
    processes: list[subprocess.Popen[str]] = []

    def start(*words: str | Path) -> subprocess.Popen[str]:
        command = [sys.executable, "-m", *map(str, words)]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        processes.append(process)
        return process

    yield start
    for process in processes:
        process.kill()
        process.communicate()


def _wait_until(is_so: Callable[[], bool]) -> None:
    end = time.monotonic() + _MOST_SEC
    while not is_so():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_killed_workers_cost_a_retry_and_no_result(
    pool: DaskPool, short: tuple[StudyCell, ...], tmp_path: Path
) -> None:
    """All workers of a cluster are killed once while they work: the bytes are those of one process here."""
    before: set[int] = set()

    def kill(done: int, total: int) -> None:
        if done == 1 and total == len(short):
            before.update(pool.client.run(os.getpid).values())
            for pid in before:
                os.kill(pid, signal.SIGKILL)

    folder = run_study(short, tmp_path / "dask", pool, kill)
    assert before
    assert before.isdisjoint(pool.client.run(os.getpid).values())
    assert bytes_of(folder) == bytes_of(run_study(short, tmp_path / "here", LocalPool(1)))


def test_a_worker_of_other_versions_is_refused(
    pool: DaskPool, short: tuple[StudyCell, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its bytes could be others."""
    other = {**_versions(), "numpy": "0.1"}
    monkeypatch.setattr("bags.study.cluster._versions", lambda: other)
    with pytest.raises(StudyError, match=r"a worker has numpy [\d.]+, expected 0\.1 as here"):
        run_study(short[:1], tmp_path, pool)


def test_what_an_observer_refuses_is_said_in_one_line(
    pool: DaskPool, short: tuple[StudyCell, ...], tmp_path: Path
) -> None:
    """As without a cluster."""
    wrong = replace(short[0], observer=short[0].observer.model_copy(update={"options": {"strategy": "none"}}))
    with pytest.raises(StudyError, match="observer data-driven: full_order: option strategy"):
        run_study([wrong], tmp_path, pool)


def test_a_study_outlives_its_client_a_worker_and_its_scheduler(
    tiny_file: Path, tmp_path: Path, started: Callable[..., subprocess.Popen[str]]
) -> None:
    """`dask scheduler` and `dask worker`: the command, a worker, the scheduler are killed; each time it goes on."""
    file, out = tmp_path / "scheduler.json", tmp_path / "out"
    words = ("dask", "scheduler", "--port", "0", "--scheduler-file", file, *_OURS.split())
    worker = ("dask", "worker", "--scheduler-file", file, "--nthreads", "1", "--no-nanny", *_OURS.split())
    scheduler = started(*words)
    _wait_until(file.is_file)
    first = started(*worker)
    client = started("dcmg", "study", tiny_file, "--seeds", "32", "--dask", file, "--out", out)
    _wait_until(lambda: _parts(out) != {})
    client.kill()
    client.wait()
    first.kill()
    cells = cells_of(load_study(tiny_file, ["seeds=32"]), "tiny.yaml", scenario_path)
    done, counts = _parts(out), list[int]()
    assert 0 < len(done) < len(cells)
    assert not (out / "table").exists()

    def kill(finished: int, total: int) -> None:
        counts.append(finished)
        if finished < total and finished == len(done) + 1:
            scheduler.kill()

    started(*worker)
    with (
        config.set({"distributed.comm.timeouts.connect": "6s"}),
        dask_pool(str(file)) as pool,
        pytest.raises(StudyError, match=r"its Dask scheduler is gone: start again to go on$"),
    ):
        run_study(cells, out, pool, kill)
    file.unlink()
    started(*words)
    _wait_until(file.is_file)
    started(*worker)
    with dask_pool(str(file)) as pool:
        folder = run_study(cells, out, pool)
    assert counts[:2] == [len(done), len(done) + 1]
    assert done.items() <= _parts(out).items()
    assert bytes_of(folder) == bytes_of(run_study(cells, tmp_path / "here", LocalPool(2)))


def _parts(out: Path) -> dict[str, int]:
    """When each part was written."""
    return {path.name: path.stat().st_mtime_ns for path in (out / "parts").glob("*.parquet")}


@pytest.mark.parametrize(
    ("where", "expected"),
    [
        ("local:0", "local:0: expected local or local:N"),
        ("locale", "locale: expected the address of a Dask scheduler"),
        ("tcp://nowhere", "tcp://nowhere: expected the address of a Dask scheduler"),
        ("tcp://127.0.0.1:9", "tcp://127.0.0.1:9: no Dask scheduler answers: "),
    ],
)
def test_a_wrong_place_is_refused(where: str, expected: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """One line, with what was expected."""
    monkeypatch.setattr("bags.study.cluster._ANSWER_SEC", 0.2)
    with pytest.raises(StudyError, match=re.escape(expected)) as caught, dask_pool(where):
        pass
    assert "\n" not in str(caught.value)


def test_without_dask_one_line_says_what_to_install(tiny_file: Path, tmp_path: Path) -> None:
    """Exit code 2, before anything is written."""
    code = "import sys; sys.modules['distributed'] = None; from dcmg.cli import main; main()"
    words = ("study", str(tiny_file), "--dask", "local", "--out", str(tmp_path / "out"))
    done = subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr == "dcmg: --dask needs the Python package distributed, found none: pip install 'dcmg[studies]'\n"
    assert not (tmp_path / "out").exists()
