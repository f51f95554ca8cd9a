"""All monitors at once against each monitor alone."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bags.runs.replay import histories_of
from bags.runs.run_record import RunRecord
from bags.watch.designs import design_run
from bags.watch.monitors import RunMonitors, alarm_changes, monitors_of
from bags.wire.convert import history_of, history_records
from bags.wire.settings import settings_of
from dgu_sim.experiment import run_experiments
from dgu_sim.grid import Link
from dgu_sim.scenario import Scenario
from monitor import detectors
from monitor.history import Experiment, History
from monitor.link_monitor import LinkMonitor
from monitor.settings import DetectorSettings, ObserverSettings


@pytest.fixture(scope="module", name="monitors")
def _monitors(record: RunRecord, scenario: Scenario) -> RunMonitors:
    histories = histories_of(record)
    still = np.zeros((20, 3))
    histories[3] = History((Experiment(np.empty((20, 0)), still, still, 0.01),), 0.01)
    return monitors_of(design_run(record.topics, settings_of(scenario), histories))


def test_refused_links_stay_silent(monitors: RunMonitors, record: RunRecord) -> None:
    """The history of DGU 3 teaches nothing: the link from it is REFUSED throughout, the others are monitored."""
    assert [design.accepted for design in monitors.designs] == [True, False, True, True]
    _, outputs = monitors.run(monitors.init(), record.received, record.delivered)
    silent = record.links.index(Link(3, 1))
    assert not outputs.phase[:, silent].any()
    assert not outputs.alarm[:, silent].any()
    assert np.isnan(outputs.residual[:, silent]).all()
    assert outputs.phase[-1].tolist() == [3, 0, 3, 3]


@settings(max_examples=25, deadline=None)  # every example steps four monitors
@given(
    lost=st.sets(st.tuples(st.integers(0, 119), st.integers(0, 3)), max_size=6),
    cut=st.integers(0, 120),
)
def test_stacked_monitors_have_the_bits_of_single_ones(
    monitors: RunMonitors, record: RunRecord, scenario: Scenario, lost: set[tuple[int, int]], cut: int
) -> None:
    """Arrays over links, in blocks of any length, give the bits of floats link by link, lost samples included."""
    received, delivered = record.received[:120].copy(), record.delivered[:120].copy()
    for step, position in lost:
        received[step, position], delivered[step, position] = np.nan, False
    states, early = monitors.run(monitors.init(), received[:cut], delivered[:cut])
    _, late = monitors.run(states, received[cut:], delivered[cut:])
    settings_ = settings_of(scenario).detector
    detector = detectors.build(settings_.kind, settings_.options, scenario.sampling_period_sec)
    for position, design in enumerate(monitors.designs):
        single = LinkMonitor(observer=design.observer, detector=detector)
        state = single.init()
        for step in range(120):
            sample = received[step, position].tolist()
            state, expected = single.step(state, sample, bool(delivered[step, position]))
            found = early.at(step, position) if step < cut else late.at(step - cut, position)
            for name in ("estimate", "residual", "threshold"):
                assert np.array_equal(getattr(found, name), getattr(expected, name), equal_nan=True)
            assert (found.phase, found.alarm) == (int(expected.phase), bool(expected.alarm))


@pytest.mark.parametrize(
    ("kind", "options"), [("delayed", {"delay": 2}), ("delayed", {"goal": "bounded"}), ("cl_uie", {"future": 2})]
)
def test_stacked_observers_of_other_kinds_have_the_bits_of_single_ones(
    kind: str, options: dict[str, object], record: RunRecord, scenario: Scenario
) -> None:
    """Observers around an operating point, and those without a state estimate, step together with the same bits."""
    chosen = settings_of(scenario).model_copy(update={"observer": ObserverSettings(kind=kind, options=options)})
    longer = scenario.model_copy(update={"history": scenario.history.model_copy(update={"samples": 60})})
    histories = {dgu: history_of(history_records(dgu, run_experiments(longer, dgu))) for dgu in record.topics.dgus}
    monitors = monitors_of(design_run(record.topics, chosen, histories))
    assert [group.positions.tolist() for group in monitors.groups] == [[0, 1, 2, 3]]
    _, found = monitors.run(monitors.init(), record.received[:80], record.delivered[:80])
    detector = detectors.build(chosen.detector.kind, chosen.detector.options, scenario.sampling_period_sec)
    for position, design in enumerate(monitors.designs):
        single = LinkMonitor(observer=design.observer, detector=detector)
        state = single.init()
        for step in range(80):
            sample = record.received[step, position].tolist()
            state, expected = single.step(state, sample, bool(record.delivered[step, position]))
            for name in ("estimate", "residual", "threshold"):
                assert np.array_equal(getattr(found.at(step, position), name), getattr(expected, name), equal_nan=True)


def test_accepted_links_step_together(monitors: RunMonitors) -> None:
    """Observers of one shape are one group; a refused link is in none."""
    assert [group.positions.tolist() for group in monitors.groups] == [[0, 2, 3]]


def test_alarm_changes_are_in_order() -> None:
    """Starts and ends are told by step, then by monitor and source, relative to the step before."""
    links = (Link(2, 1), Link(1, 2), Link(3, 2))
    alarm = np.array([[True, False, True], [True, True, False], [True, True, False]])
    before = np.array([True, False, False])
    assert alarm_changes(alarm, before, links) == [(0, 2), (1, 1), (1, 2)]


@pytest.mark.parametrize("kind", list(detectors.KINDS))
def test_detectors_judge_many_steps_as_they_judge_each(kind: str, record: RunRecord, scenario: Scenario) -> None:
    """Whatever the detector, a run evaluated at once has the bits of one evaluated step by step."""
    short = {"settle_sec": 0.1, "calibrate_sec": 0.5}
    needed: dict[str, dict[str, object]] = {
        "n_of_m": {"options": short},
        "calibrated": {"rate": 0.1},
        "noise_bound": {"noise": 0.05},
    }
    options: dict[str, object] = {
        name: short[name] for name in short if name in detectors.filled_in(kind, needed.get(kind, {}))
    }
    options |= needed.get(kind, {})
    chosen = settings_of(scenario).model_copy(update={"detector": DetectorSettings(kind=kind, options=options)})
    monitors = monitors_of(design_run(record.topics, chosen, histories_of(record)))
    received, delivered = record.received[90:220].copy(), record.delivered[90:220].copy()
    received[70, 2], delivered[70, 2] = np.nan, False
    _, together = monitors.run(monitors.init(), received, delivered)
    states = monitors.init()
    for step in range(len(received)):
        states, alone = monitors.run(states, received[step : step + 1], delivered[step : step + 1])
        for name in ("phase", "alarm", "estimate", "residual", "threshold"):
            assert getattr(alone, name)[0].tobytes() == getattr(together, name)[step].tobytes(), (step, name)
    assert together.phase[-1].tolist() == [3, 3, 3, 3]
