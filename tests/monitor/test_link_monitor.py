"""One link monitored: delivery, gaps, partial outputs, refusals, floats against arrays."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from monitor.detectors import Phase, build
from monitor.errors import MonitorError
from monitor.link_monitor import LinkMonitor, MonitorOutput
from monitor.observers import LinearObserver, design

if TYPE_CHECKING:
    from collections.abc import Callable

    from monitor.history import History
    from monitor.linear import Vector
    from tests.monitor.conftest import Plant

OPTIONS = {"settle_sec": 0.1, "calibrate_sec": 0.2, "margin": 5.0, "floor": 1e-6}
DETECTOR = build("fixed", OPTIONS, 0.01)
START, STOP = 60, 100


@pytest.fixture
def monitor(dgu_history: Callable[..., History]) -> LinkMonitor:
    """A monitor of DGU 1."""
    return LinkMonitor(design("full_order", dgu_history(), {}).observer, DETECTOR)


@pytest.fixture
def outputs(dgu: Callable[[int], Plant]) -> np.ndarray:
    """What DGU 1 sends over 120 steps of random load and reference."""
    generator = np.random.default_rng(3)
    d = np.array([10.0, 48.0]) + generator.uniform(-1.0, 1.0, (120, 2))
    return dgu(1).run(np.array([47.0, 9.0, 11.0]), np.zeros((120, 0)), d)[1]


def _numbers(vector: Vector) -> np.ndarray:
    return np.array([float(component) for component in vector])


def _run(monitor: LinkMonitor, received: np.ndarray, lost: tuple[int, ...] = ()) -> list[MonitorOutput]:
    state = monitor.init()
    found = []
    for step, y in enumerate(received.tolist()):
        state, output = monitor.step(state, y, step not in lost)
        found.append(output)
    return found


def test_bias_is_seen_from_its_first_sample(monitor: LinkMonitor, outputs: np.ndarray) -> None:
    """No alarm before the attack; an alarm at its first sample, with the published residual."""
    received = outputs.copy()
    received[START:] += 0.1
    found = _run(monitor, received)
    assert not any(output.alarm for output in found[:START])
    assert found[START].alarm
    # r(50) of T's experiment, to its four published decimals.
    assert np.allclose(_numbers(found[START].residual), (-0.0148, -0.0029, 0.0642), atol=1e-4)


def test_lost_samples_restart_the_observer(monitor: LinkMonitor, outputs: np.ndarray) -> None:
    """A lost sample gives NaN, no alarm follows, and the thresholds are kept."""
    found = _run(monitor, outputs, lost=(70, 71))
    for step in (70, 71):
        assert found[step].phase == Phase.SETTLING
        assert all(math.isnan(value) for value in (*found[step].residual, *found[step].estimate))
    assert [output.phase for output in found[72:82]] == [Phase.SETTLING] * 10
    assert found[82].phase == Phase.ARMED
    assert found[82].threshold == found[69].threshold
    assert not any(output.alarm for output in found)
    assert np.allclose(_numbers(found[110].estimate), outputs[110], atol=1e-9)


@pytest.mark.parametrize("poison", [math.nan, math.inf, -math.inf])
def test_poison_does_not_stay(monitor: LinkMonitor, outputs: np.ndarray, poison: float) -> None:
    """A component that is no usable number does not disturb the observer for good."""
    received = outputs.copy()
    received[70, 1] = poison
    found = _run(monitor, received)
    assert np.allclose(_numbers(found[-1].estimate), outputs[-1], atol=1e-9)
    assert found[-1].phase == Phase.ARMED
    assert not found[-1].alarm


def test_refused_design_says_nothing() -> None:
    """Without an observer the phase is REFUSED and every number NaN."""
    monitor = LinkMonitor(None, DETECTOR)
    _, output = monitor.step(monitor.init(), (1.0, 2.0, 3.0), True)  # noqa: FBT003 - delivered
    assert output.phase == Phase.REFUSED
    assert output.alarm is False
    assert np.isnan([*output.estimate, *output.residual, *output.threshold]).all()


def test_blind_observer_gives_its_estimate_only(monitor: LinkMonitor, outputs: np.ndarray) -> None:
    """A blind residual is not published as zero: it is NaN, and the estimate goes on."""
    output = _run(replace(monitor, blind=True), outputs)[-1]
    assert output.phase == Phase.REFUSED
    assert np.isnan(_numbers(output.residual)).all()
    assert np.allclose(_numbers(output.estimate), outputs[-1], atol=1e-9)


def test_floats_and_arrays_have_the_same_bits(dgu_history: Callable[..., History], outputs: np.ndarray) -> None:
    """Three links in arrays over (runs, links) give the bits that each gives alone in floats."""
    observers = [design("full_order", dgu_history(number), {}).observer for number in (1, 2, 3)]
    whole = np.stack([np.array(one._whole) for one in observers if isinstance(one, LinearObserver)], axis=-1)
    start = np.stack([np.array(one._start) for one in observers if isinstance(one, LinearObserver)], axis=-1)
    assert isinstance(observers[0], LinearObserver)
    stacked = replace(observers[0])
    object.__setattr__(stacked, "_whole", whole[:, :, None])
    object.__setattr__(stacked, "_start", start[:, :, None])
    generator = np.random.default_rng(5)
    received = outputs[:, :, None, None] + generator.standard_normal((120, 3, 2, 3))
    delivered = generator.uniform(size=(120, 2, 3)) > 0.03
    together = LinkMonitor(stacked, DETECTOR)
    alone = [[LinkMonitor(one, DETECTOR) for one in observers] for _ in range(2)]
    state = together.init()
    states = [[one.init() for one in run] for run in alone]
    for y, here in zip(received, delivered, strict=True):
        state, output = together.step(state, y, here)
        for run in range(2):
            for link in range(3):
                sample = tuple(y[:, run, link].tolist())
                states[run][link], single = alone[run][link].step(states[run][link], sample, bool(here[run, link]))
                for name in ("estimate", "residual", "threshold"):
                    bits = [float(np.broadcast_to(one, (2, 3))[run, link]) for one in getattr(output, name)]
                    assert np.array_equal(bits, getattr(single, name), equal_nan=True)
                assert single.phase == np.broadcast_to(output.phase, (2, 3))[run, link]
                assert single.alarm == np.broadcast_to(output.alarm, (2, 3))[run, link]


def test_channels_must_fit(monitor: LinkMonitor) -> None:
    """Two channels cannot feed three outputs."""
    with pytest.raises(MonitorError, match="2 channels for an observer of 3 outputs"):
        LinkMonitor(monitor.observer, DETECTOR, channels=(0, 1))
