"""Samples of any width: five outputs, four states and two known inputs, from a table to the report."""

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bags.foreign.importing import import_histories, import_streams
from bags.foreign.mapping import mapping_of
from bags.mcap.bag import open_bag
from bags.mcap.errors import BagError
from bags.reporting.options import ReportOptions
from bags.reporting.write import write_report
from bags.runs.reader import open_run, read_run
from bags.runs.replay import histories_of, replay, replay_windows
from bags.runs.replay_bag import write_replayed
from bags.runs.run_record import RunRecord
from bags.watch.designs import design_run
from monitor.link_monitor import LinkMonitor
from monitor.settings import MonitorSettings

A = np.array([[0.8, 0.1, 0.0, 0.1], [0.0, 0.6, 0.2, 0.0], [0.1, 0.0, 0.5, 0.1], [0.0, 0.2, 0.0, 0.7]])
B = np.array([[1.0, 0.0], [0.5, 0.2], [0.0, 1.0], [0.3, 0.0]])
E = np.array([1.0, 0.0, 0.5, 0.0])
C = np.vstack([np.eye(4), [1.0, 1.0, 0.0, 1.0]])
NAMES = {"y": 5, "u": 2, "x": 4}
T_S, ONSET, STEPS = 0.05, 150, 260
DETECTOR = {"kind": "fixed", "options": {"settle_sec": 0.5, "calibrate_sec": 2.0, "floor": 1e-6}}


def _record(file: Path, seed: int, steps: int, *, bias: float = 0.0) -> None:
    """A table of samples; from the onset on the first output is falsified."""
    rng = np.random.default_rng(seed)
    u, d, x = rng.uniform(-1, 1, (steps, 2)), rng.uniform(-1, 1, steps), np.zeros((steps, 4))
    x[0] = rng.uniform(-1, 1, 4)
    for k in range(steps - 1):
        x[k + 1] = A @ x[k] + B @ u[k] + E * d[k]
    y = x @ C.T
    y[ONSET:, 0] += bias
    columns = [f"{name}{number}" for name, size in NAMES.items() for number in range(size)]
    with file.open("w", newline="") as stream:
        table = csv.writer(stream)
        table.writerow(["t", *columns])
        table.writerows([repr(T_S * k), *map(repr, row)] for k, row in enumerate(np.hstack([y, u, x]).tolist()))


def _names(name: str) -> list[str]:
    return [f"{name}{number}" for number in range(NAMES[name])]


@pytest.fixture(scope="module", name="imported")
def _imported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The stream of a plant that is no DGU, with its history, as a bag."""
    folder = tmp_path_factory.mktemp("wide")
    _record(folder / "history.csv", 1, 80)
    _record(folder / "stream.csv", 2, STEPS, bias=0.3)
    history = mapping_of({"time": "t", "histories": [{"dgu": 1, **{name: _names(name) for name in NAMES}}]}, "test")
    import_histories(folder / "history.csv", history, folder / "history")
    streams = [{"link": "1-2", "y": _names("y"), "u": _names("u")}]
    keys: dict[str, Any] = {"time": "t", "streams": streams, "monitor": {"detector": DETECTOR}}
    import_streams(folder / "stream.csv", mapping_of(keys, "test"), folder / "bag", folder / "history")
    return folder / "bag"


@pytest.fixture(scope="module", name="watched")
def _watched(imported: Path) -> RunRecord:
    return replay(imported)


def test_every_number_arrives(imported: Path) -> None:
    """Five outputs and two known inputs travel together, and the histories say that there are four states."""
    record = read_run(imported)
    assert record.topics.widths[:3] == (5, 4, 2)
    assert (record.received.shape, record.u.shape) == ((STEPS, 1, 5), (STEPS, 1, 2))
    block = open_bag(imported).array("/dgu_2/received/dgu_1").data
    assert block["y"].tobytes() == record.received[:, 0].tobytes()
    assert block["u"].tobytes() == record.u[:, 0].tobytes()


def test_the_lie_is_found_and_the_state_estimated(watched: RunRecord) -> None:
    """The observer uses what it is told of u: no residual before the attack, an alarm with its first sample."""
    assert watched.estimate.shape == (STEPS, 1, 4)
    assert np.nanmax(np.abs(watched.residual[20:ONSET])) < 1e-9
    assert [(one.step, one.active) for one in watched.alarms][:1] == [(ONSET, True)]


def test_steps_one_by_one_give_the_same_bits(watched: RunRecord) -> None:
    """What a live monitor concludes in floats is what the replay concludes at once."""
    settings = MonitorSettings.model_validate({"detector": DETECTOR})
    (monitor,) = design_run(watched.topics, settings, histories_of(watched)).monitors[0].links
    assert isinstance(monitor, LinkMonitor)
    state, found = monitor.init(), []
    for y, u in zip(watched.received[:, 0].tolist(), watched.u[:, 0].tolist(), strict=True):
        state, output = monitor.step(state, y, delivered=True, u=u)
        found.append(output)
    for name in ("estimate", "residual", "threshold"):
        singly = np.array([getattr(one, name) for one in found])
        assert singly.tobytes() == np.ascontiguousarray(getattr(watched, name)[:, 0]).tobytes(), name


def test_what_is_unknown_of_u_is_a_lost_sample(watched: RunRecord) -> None:
    """A known input that is missing restarts the observer; it never becomes a residual."""
    u = watched.u.copy()
    u[100, 0, 1] = np.nan
    again = replay(watched.with_arrays({"received.u": u}))
    assert np.isnan(again.residual[100]).all()
    assert np.nanmax(np.abs(again.residual[110:ONSET])) < 1e-9


def test_replayed_bag_and_report(imported: Path, tmp_path: Path) -> None:
    """The replay is a bag like any other, with residuals as wide as the samples, and has a report."""
    run = open_run(imported)
    windows = write_replayed(tmp_path / "replayed", replay_windows(run.windows(100)), {})
    made = write_report(windows, run.steps, tmp_path / "report", ReportOptions())
    assert made.html.stat().st_size > 0
    again = read_run(tmp_path / "replayed")
    assert again.topics.widths[:3] == (5, 4, 2)
    assert [one.step for one in again.alarms][:1] == [ONSET]


def test_histories_need_no_more_inputs_than_samples_carry(watched: RunRecord) -> None:
    """An observer of known inputs cannot watch samples without them: one line."""
    topics = watched.topics
    bare = type(topics)(
        dgus=topics.dgus, links=topics.links, sampling_period_ns=1, widths=topics.widths._replace(inputs=0)
    )
    with pytest.raises(BagError, match="DGU 1 has 2 known inputs u, expected at most 0"):
        design_run(bare, MonitorSettings.model_validate({"detector": DETECTOR}), histories_of(watched))
