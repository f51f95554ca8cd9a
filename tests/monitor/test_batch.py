"""A whole recording at once is the recording step by step, bit for bit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from monitor import detectors
from monitor.constant_input import ConstantInput
from monitor.detectors.batch import run_detector
from monitor.detectors.protocol import matched
from monitor.errors import HistoryError
from monitor.linear_observer import LinearObserver

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.observer import Observer

SHAPES = st.one_of(
    st.tuples(st.integers(0, 4), st.integers(1, 4), st.integers(1, 4), st.integers(0, 2)),
    st.sampled_from([(3, 3, 3, 0), (3, 2, 3, 1)]),
)


def _observer(rng: np.random.Generator, order: int, outputs: int, states: int, inputs: int) -> LinearObserver:
    def some(rows: int, columns: int) -> NDArray[np.float64]:
        found: NDArray[np.float64] = rng.normal(size=(rows, columns)) * rng.choice(
            [0.0, 0.1, 0.5], size=(rows, columns)
        )
        return found

    received = inputs + outputs
    return LinearObserver(
        A=some(order, order),
        B=some(order, received),
        M=some(states, order),
        D=some(states, received),
        H=some(outputs, order),
        J=some(outputs, received),
        Z=some(order, received),
        inputs=inputs,
        outputs=outputs,
    )


def _stepped(observer: Observer, u: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[bytes, bytes]:
    state, estimates, residuals = observer.init(u[0].tolist(), y[0].tolist()), [], []
    for known, heard in zip(u.tolist(), y.tolist(), strict=True):
        state, found = observer.step(state, known, heard)
        estimates.append(found.estimate)
        residuals.append(found.residual)
    return np.array(estimates, dtype=float).tobytes(), np.array(residuals, dtype=float).tobytes()


@settings(deadline=None, derandomize=True, max_examples=60)
@given(
    shape=st.one_of(SHAPES, st.just((3, 3, 3, 0)), st.just((3, 2, 3, 1))), seed=st.integers(0, 999), gap=st.booleans()
)
def test_a_recording_is_what_steps_give(shape: tuple[int, int, int, int], seed: int, *, gap: bool) -> None:
    """Any order and number of signals, with missing samples too, whose NaN spreads as it does step by step."""
    rng = np.random.default_rng(seed)
    observer = _observer(rng, *shape)
    y, u = rng.normal(size=(50, observer.outputs)), rng.normal(size=(50, observer.inputs))
    if gap:
        y[20:23] = np.nan
    found = observer.run(u, y)
    assert (found.estimate.tobytes(), found.residual.tobytes()) == _stepped(observer, u, y)


def test_recordings_longer_than_a_block_go_on_where_it_ended() -> None:
    """Order and outputs 3, the case that is written out."""
    rng = np.random.default_rng(5)
    observer = _observer(rng, 3, 3, 3, 0)
    y = rng.normal(size=(20_001, 3))
    found = observer.run(None, y)
    assert (found.estimate.tobytes(), found.residual.tobytes()) == _stepped(observer, np.empty((20_001, 0)), y)


def test_the_constant_input_is_put_in() -> None:
    """Whoever runs it does not give it."""
    rng = np.random.default_rng(2)
    observer = ConstantInput(_observer(rng, 2, 3, 3, 2))
    y, u = rng.normal(size=(30, 3)), rng.normal(size=30)
    found = observer.run(u, y)
    assert (found.estimate.tobytes(), found.residual.tobytes()) == _stepped(observer, u[:, None], y)


def test_a_first_estimate_is_the_first_estimate() -> None:
    """x0 sets the state such that the estimate begins there; the wrong length is refused in a line."""
    rng = np.random.default_rng(4)
    observer = LinearObserver(
        A=0.5 * np.eye(2),
        B=rng.normal(size=(2, 2)),
        M=np.eye(2),
        D=rng.normal(size=(2, 2)),
        H=-np.eye(2),
        J=np.eye(2),
        Z=np.zeros((2, 2)),
        inputs=0,
        outputs=2,
    )
    found = observer.run(None, rng.normal(size=(10, 2)), x0=[3.0, -2.0])
    np.testing.assert_allclose(found.estimate[0], [3.0, -2.0], rtol=1e-12)
    with pytest.raises(HistoryError, match=r"x0 has shape \(3,\), expected \(2,\)"):
        observer.run(None, np.zeros((10, 2)), x0=[1.0, 2.0, 3.0])
    assert observer.run(None, np.zeros((0, 2))).estimate.shape == (0, 2)


@pytest.mark.parametrize("kind", sorted(detectors.KINDS))
@pytest.mark.parametrize("gap", [False, True])
def test_residuals_at_once_are_judged_as_one_by_one(kind: str, *, gap: bool) -> None:
    """Every kind, with and without samples that never came."""
    rng = np.random.default_rng(1)
    residual = 1e-3 * rng.normal(size=(1500, 3))
    residual[1400:] += 1.0
    if gap:
        residual[700:710] = np.nan
    options = {"noise": 1e-3} if kind == "noise_bound" else {}
    detector = matched(detectors.build(kind, options, 0.01), _observer(rng, 3, 3, 3, 0))
    found = run_detector(detector, residual)
    state = detector.init(3)
    for step, row in enumerate(residual.tolist()):
        state, verdict = detector.step(state, row)
        assert bool(verdict.alarm) == found.alarm[step]
        assert np.array(verdict.threshold, dtype=float).tobytes() == found.threshold[step].tobytes()
