"""The noise-bound detector: no false alarm within the bound, and the bound is the smallest that can say so."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from bags.watch.stacked_observer import StackedObserver
from monitor.detectors import build, matched
from monitor.detectors.noise_bound import NoiseBoundDetector
from monitor.errors import MonitorError
from monitor.observers import LinearObserver, design

if TYPE_CHECKING:
    from collections.abc import Callable

    from monitor.history import History

NOISE = [0.01, 0.02, 0.003]
FLOOR = 1e-12
OPTIONS = {"noise": NOISE, "floor": FLOOR}


def _matched(uio: LinearObserver, settle_sec: float = 0.5) -> NoiseBoundDetector:
    detector = matched(build("noise_bound", {**OPTIONS, "settle_sec": settle_sec}, 0.01), uio)
    assert isinstance(detector, NoiseBoundDetector)
    return detector


@pytest.mark.parametrize("settle_sec", [0.0, 0.5])
def test_no_false_alarm_in_a_million_steps(
    judge: Callable[..., Any], filtered: Callable[..., Any], uio: LinearObserver, settle_sec: float
) -> None:
    """Noise at its bound with random signs, and uniform noise: not one alarm, armed from the first sample or later."""
    generator = np.random.default_rng(1)
    noise = generator.uniform(-1.0, 1.0, (1000, 3, 1000))
    noise[:, :, ::2] = np.sign(noise[:, :, ::2])
    noise *= np.array(NOISE)[:, None]
    detector = _matched(uio, settle_sec)
    judged = judge(detector, filtered(uio, noise))
    assert judged.alarm.size == 1_000_000
    assert not judged.alarm.any()


def test_the_worst_noise_comes_up_to_the_bound(filtered: Callable[..., Any], uio: LinearObserver) -> None:
    """The bound is attained: the noise with the signs of the impulse response gets as high, for each component."""
    detector = _matched(uio)
    assert detector.bound is not None
    steps = 60  # A_UIO^60 is below rounding: eigenvalue -0.17
    impulse = np.zeros((steps + 1, 3, 3))
    for output in range(3):
        impulse[1, output, output] = 1.0  # not at the first sample, which also sets the state
    response = filtered(uio, impulse)[1:]  # (lag, residual, output)
    for component in range(3):
        worst = np.sign(response[::-1, component, :])[:, :, None] * np.array(NOISE)[:, None]
        reached = abs(filtered(uio, np.concatenate([np.zeros((1, 3, 1)), worst]))[-1, component, 0])
        assert reached <= float(detector.bound[component])
        assert reached == pytest.approx(float(detector.bound[component]) - FLOOR, rel=1e-9)


def test_bound_is_the_one_of_the_theory(uio: LinearObserver) -> None:
    """Rbar = (|I - D| + sum_j |A_U^j B_U|) rhobar for long t: theory section 8."""
    total = np.abs(uio.J)
    power = np.eye(3)
    for _ in range(60):
        total = total + np.abs(uio.H @ power @ uio.B)
        power = uio.A @ power
    detector = _matched(uio)
    assert detector.bound is not None
    np.testing.assert_allclose(np.array(detector.bound), total @ NOISE + FLOOR, rtol=1e-9)


def test_an_attack_above_twice_the_bound_is_seen_through_any_noise(
    judge: Callable[..., Any], filtered: Callable[..., Any], uio: LinearObserver
) -> None:
    """Detection is certain once the attack's own residual exceeds 2 rbar."""
    detector = _matched(uio)
    assert detector.bound is not None
    noise = np.random.default_rng(2).uniform(-1.0, 1.0, (100, 3, 50)) * np.array(NOISE)[:, None]
    attack = np.zeros((100, 3, 50))
    attack[50:] = np.array([0.1, 0.1, 0.1])[:, None]
    share = np.abs(filtered(uio, attack)[50:, :, 0]).max(axis=0) / np.array(detector.bound, dtype=np.float64)
    scaled = attack * (2.01 / share.max())
    assert judge(detector, filtered(uio, noise + scaled)).alarm[50:].any(axis=0).all()


def test_it_needs_its_observer() -> None:
    """Unmatched, or with noise for another number of outputs: one line."""
    detector = build("noise_bound", OPTIONS, 0.01)
    with pytest.raises(MonitorError, match="expected a detector matched to its observer"):
        detector.init(3)
    with pytest.raises(MonitorError, match="option noise"):
        build("noise_bound", {}, 0.01)


def test_noise_must_fit_the_outputs(uio: LinearObserver) -> None:
    """Two noise levels for three outputs are refused."""
    with pytest.raises(MonitorError, match="noise has 2 components, expected 1 or 3"):
        matched(build("noise_bound", {"noise": [0.1, 0.1]}, 0.01), uio)


def test_observers_side_by_side_get_their_own_bounds(dgu_history: Callable[..., History]) -> None:
    """Matched to several links' observers stepped as one, it has the bits of each alone."""
    built = [design("full_order", dgu_history(number), {}).observer for number in (1, 2, 3)]
    alone = [one for one in built if isinstance(one, LinearObserver)]
    whole = [np.block([[one.H, one.J], [one.M, one.D], [one.A, one.B]]) for one in alone]
    start = np.stack([one.Z for one in alone], axis=-1)
    together = StackedObserver(whole=np.stack(whole, axis=-1), start=start, inputs=0, outputs=3, states=3)
    detector = build("noise_bound", OPTIONS, 0.01)
    stacked = matched(detector, together)
    assert isinstance(stacked, NoiseBoundDetector)
    assert stacked.bound is not None
    for position, observer in enumerate(alone):
        bound = _matched(observer).bound
        assert bound is not None
        assert [float(np.asarray(one)[position]) for one in stacked.bound] == [float(one) for one in bound]
