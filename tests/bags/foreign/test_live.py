"""Live sampling and the monitors behind it, without ROS: the clocks are numbers."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bags.foreign.importing import import_histories, import_streams
from bags.foreign.live import Early, LiveState, live_sampling
from bags.foreign.mapping import Mapping, mapping_of
from bags.foreign.sampling import Row
from bags.foreign.stream_monitors import stream_monitors
from bags.mcap.errors import BagError
from bags.runs.reader import read_run
from bags.runs.replay import replay
from bags.runs.run_record import RunRecord
from monitor.detectors import Phase

T = 10_000_000
LATE = 10 * T
SECOND = 1_000_000_000


def _hear(tracks: int, *messages: tuple[int, int, int], late_sec: float = 0.1) -> tuple[LiveState, Sequence[Row]]:
    """Messages (track, stamp, local time): state and rows."""
    sampling = live_sampling(mapping_of({"sampling": {"late_sec": late_sec}}, "test"), tracks, T)
    state = sampling.init()
    found: list[Row] = []
    for track, stamp, now in messages:
        state, rows = sampling.hear(state, Early(track, stamp, (float(stamp),)), now)
        found += rows
    return state, found


def test_grid_starts_when_every_topic_speaks() -> None:
    """Rows begin with the last topic's first message; a topic that stays silent is waited for, not forever."""
    _, rows = _hear(2, (0, 0, 0), (0, T, T), (1, 2 * T, 2 * T), (0, 2 * T, 2 * T))
    assert [row.instant_ns for row in rows] == [2 * T]
    sampling = live_sampling(mapping_of({}, "test"), 2, T)
    state, _ = _hear(2, (0, 0, 0), (0, T, T))
    state, rows = sampling.wait(state, 4 * SECOND)
    assert not rows
    state, rows = sampling.wait(state, 6 * SECOND)
    state, more = sampling.wait(state, 6 * SECOND)
    assert [row.values for row in (*rows, *more)][:2] == [((0.0,), None), ((float(T),), None)]


def test_silence_becomes_missing_samples() -> None:
    """After late_sec without a message the missing samples come, one a period, and a late message comes in vain."""
    sampling = live_sampling(mapping_of({}, "test"), 1, T)
    state, rows = _hear(1, (0, 0, 100), (0, T, 100 + T))
    assert len(rows) == 2
    state, rows = sampling.wait(state, 100 + T + LATE)
    assert not rows
    state, rows = sampling.wait(state, 100 + 5 * T + LATE)
    assert [row.values for row in rows] == [(None,)] * 3
    state, rows = sampling.hear(state, Early(0, 2 * T, (1.0,)), 100 + 5 * T + LATE)
    assert not rows
    assert state.sampler is not None
    assert state.sampler.late == 1


@pytest.mark.parametrize("jump", [-3600 * SECOND, 3600 * SECOND])
def test_jumping_clocks_start_the_grid_anew(jump: int) -> None:
    """An hour forth or back is no hour of missing samples."""
    state, rows = _hear(1, (0, 0, 0), (0, T, T), (0, jump, 2 * T), (0, jump + T, 3 * T))
    assert [row.instant_ns for row in rows] == [0, T, jump, jump + T]
    assert state.restarts == 1


def _mapping(**changes: Any) -> Mapping:  # noqa: ANN401 - keys of a mapping
    y = ["/radio.data[0]", "/radio.data[1]", {"field": "/radio.data[2]", "unit": "mV s"}]
    data = {
        "streams": [{"link": "1-2", "y": y, "delivered": "/radio.data[3]"}],
        "monitor": {"detector": {"kind": "fixed", "options": {"settle_sec": 0.1, "calibrate_sec": 0.5}}},
        **changes,
    }
    return mapping_of(data, "test")


def _messages(record: RunRecord) -> Iterator[tuple[int, tuple[float, ...]]]:
    link = [str(one) for one in record.links].index("1-2")
    for step, y in enumerate(record.received[:, link].tolist()):
        if step % 50 != 20:  # every half second one is lost
            yield step * T, (y[0], y[1], y[2] * 1000.0, float(step != 33))


def test_live_is_as_imported_and_replayed(
    record: RunRecord, bag: Path, write_arrays: Callable[..., Path], tmp_path: Path
) -> None:
    """The same messages, live and recorded, give the same samples, residuals and alarms, bit for bit."""
    messages = list(_messages(record))
    stamps, rows = zip(*messages, strict=True)
    mapping = _mapping()
    out = tmp_path / "stream"
    import_streams(write_arrays({"/radio": (stamps, rows)}), mapping, out, bag)
    expected = replay(out)
    assert not expected.delivered.all()
    monitors = stream_monitors(mapping, "test", bag)
    sampling = live_sampling(mapping, 1, T)
    state, states, step = sampling.init(), monitors.init(), 0
    phases = set()
    for stamp, values in messages:
        state, found = sampling.hear(state, Early(0, stamp, values), stamp)
        for row in found:
            states, ((sample, output),) = monitors.step(states, row)
            assert sample.delivered == expected.delivered[step, 0]
            np.testing.assert_array_equal(sample.y, expected.received[step, 0])
            np.testing.assert_array_equal(output.residual, expected.residual[step, 0])
            np.testing.assert_array_equal(output.threshold, expected.threshold[step, 0])
            assert bool(output.alarm) == expected.alarm[step, 0]
            phases.add(int(output.phase))
            step += 1
    assert step == expected.steps
    assert {Phase.SETTLING.value, Phase.ARMED.value} <= phases
    assert expected.alarm.any()


@pytest.mark.parametrize("odd", [np.nan, np.inf, -np.inf])
def test_what_is_no_finite_number_is_not_delivered(
    record: RunRecord, bag: Path, write_arrays: Callable[..., Path], tmp_path: Path, odd: float
) -> None:
    """A current that is NaN or infinite from 2 s on is missing, live as imported, and counted."""
    messages = [(stamp, (y[0], odd if stamp >= 2 * SECOND else y[1], *y[2:])) for stamp, y in _messages(record)]
    stamps, rows = zip(*messages, strict=True)
    mapping = _mapping()
    out = tmp_path / "stream"
    report = import_streams(write_arrays({"/radio": (stamps, rows)}), mapping, out, bag)
    expected = replay(out)
    monitors, sampling = stream_monitors(mapping, "test", bag), live_sampling(mapping, 1, T)
    state, states, step, told = sampling.init(), monitors.init(), 0, 0
    for stamp, values in messages:
        state, found = sampling.hear(state, Early(0, stamp, values), stamp)
        for row in found:
            odd_fields = [str(one) for one in monitors.not_finite(row)]
            states, ((sample, output),) = monitors.step(states, row)
            assert sample.delivered == expected.delivered[step, 0]
            assert odd_fields == ["/radio.data[1]"] * (row.instant_ns >= 2 * SECOND and row.values[0] is not None)
            assert not (odd_fields and sample.delivered)
            np.testing.assert_array_equal(output.residual, expected.residual[step, 0])
            told += len(odd_fields)
            step += 1
    assert told == sum(stamp >= 2 * SECOND for stamp in stamps) > 0
    assert any(f"/radio.data[1]: {told} samples are no finite numbers" in one for one in report.sentences())


def test_plants_of_two_states(write_arrays: Callable[..., Path], tmp_path: Path) -> None:
    """Whoever's plant it is: two states, two outputs, live as replayed; more states than outputs need no more room."""
    generator = np.random.default_rng(4)
    A, E = np.array([[0.9, 0.2], [-0.1, 0.7]]), np.array([1.0, 0.5])
    x = [np.array([1.0, -1.0])]
    for _ in range(399):
        x.append(A @ x[-1] + E * generator.uniform(-1.0, 1.0))
    rows = [[*row, 2.0 * row[0]] for row in x]
    rows[350:] = [[V + 0.5, current, other] for V, current, other in rows[350:]]
    source = write_arrays({"/a": ([step * T for step in range(400)], rows)})
    y = ["/a.data[0]", "/a.data[1]"]
    data = {"histories": [{"dgu": 5, "y": y, "stop_sec": 1.0}], "streams": [{"link": "5-6", "y": y}], "start_sec": 1.0}
    options = {"settle_sec": 0.1, "calibrate_sec": 0.5}
    mapping = mapping_of({**data, "monitor": {"detector": {"kind": "fixed", "options": options}}}, "test")
    import_histories(source, mapping, tmp_path / "history")
    found = replay(import_streams(source, mapping, tmp_path / "stream", tmp_path / "history").out)
    assert [one.step for one in found.alarms][:1] == [250]
    assert found.estimate.shape == (300, 1, 2)
    assert np.isfinite(found.estimate[10:]).all()
    monitors = stream_monitors(mapping, "test", tmp_path / "history")
    states = monitors.init()
    for step, values in enumerate(rows[100:]):
        states, ((_, output),) = monitors.step(states, Row(0, ((values[0], values[1]),)))
        np.testing.assert_array_equal(output.residual, found.residual[step, 0])
        np.testing.assert_array_equal(output.estimate, found.estimate[step, 0])
    wide = mapping_of({"histories": [{"dgu": 5, "y": y, "x": [*y, *y]}], "streams": data["streams"]}, "test")
    import_histories(source, wide, tmp_path / "wide")
    (design,) = stream_monitors(wide, "test", tmp_path / "wide").designs
    assert design.verdict.startswith("refused: the history is not exciting: [U_p; X_p; U_f] has rank 2, expected 4")
    again = replay(import_streams(source, wide, tmp_path / "wider", tmp_path / "wide").out)
    assert again.estimate.shape == (400, 1, 4)


def test_what_does_not_fit_is_one_line(bag: Path, tmp_path: Path, write_arrays: Callable[..., Path]) -> None:
    """No streams, another period, another number of outputs, no history, no field path: one line each."""
    short = [{"link": "1-2", "y": ["/radio.data[0]"]}]
    cases = (
        (_mapping(streams=[]), "the mapping has no key streams"),
        (_mapping(sampling_period_sec=0.02), r"the history of DGU 1 is sampled every 0.01 s, expected 0.02 s"),
        (_mapping(streams=short), "stream 1-2 has 1 outputs y, expected 3 as the history of DGU 1 has"),
        (_mapping(streams=[{"link": "9-2", "y": ["/a.b"]}]), "expected a recorded history of DGU 9"),
        (_mapping(streams=[{"link": "1-2", "y": ["a", "b", "c"]}]), "field 'a': expected a topic and a field"),
    )
    for mapping, what in cases:
        with pytest.raises(BagError, match=what) as error:
            stream_monitors(mapping, "test", bag)
        assert "\n" not in str(error.value)
    source = write_arrays({"/radio": ([0, T], [[1.0, 2.0, 3.0, 1.0]] * 2)})
    import_streams(source, _mapping(), tmp_path / "stream", bag)
    assert read_run(tmp_path / "stream").steps == 2
