"""Running a state observer over recorded samples, to see what it is worth."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from monitor.linear_observer import LinearObserver
from monitor.proof import Trial, stretches

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from monitor.history import Experiment, History
    from monitor.linear import Vector
    from monitor.observer import Observer


def try_observer(
    observer: Observer, history: History, overlap: int = 1, start: Callable[[Experiment], Vector] | None = None
) -> list[Trial]:
    """Run a state observer over all stretches; an estimate that lags is compared with the state of its own step.

    Args:
        observer: in the units of the history.
        history: attack-free samples.
        overlap: samples at the start of each stretch that are not judged.
        start: state before the first sample of a stretch; by default a linear observer without lag starts where the
            recorded state puts it, any other one by `init`.
    """
    trials = []
    for one in stretches(history):
        if len(one.y) <= overlap:
            continue
        if isinstance(observer, LinearObserver):
            estimate, residual = _run_linear(observer, one, start)
        else:
            estimate, residual = _run(observer, one, start)
        lag = observer.lag
        truth = np.vstack([np.repeat(one.x[:1], lag, axis=0), one.x])[: len(one.x)]
        error = (estimate - truth if observer.states else estimate)[max(overlap, lag) :]
        size = max(float(np.max(np.abs(table), initial=0.0)) for table in (one.u, one.y, one.x))
        trials.append(Trial(error=error, residual=residual[max(overlap, lag) :], size=size))
    return trials


def right_start(observer: LinearObserver, one: Experiment) -> NDArray[np.float64]:
    """State whose first estimate is the recorded x_0 and whose first residual is zero, in least squares."""
    v = np.concatenate([one.u[0], one.y[0]])
    wanted = np.concatenate([one.x[0] - observer.D @ v, -observer.J @ v])
    return np.asarray(np.linalg.lstsq(np.vstack([observer.M, observer.H]), wanted, rcond=None)[0])


def _run_linear(
    observer: LinearObserver, one: Experiment, start: Callable[[Experiment], Vector] | None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Estimates and residuals of all samples, by matrix products."""
    v = np.hstack([one.u, one.y])
    if start is not None:
        z = np.array(start(one), dtype=np.float64)
    elif observer.lag or not observer.states:
        z = observer.Z @ v[0]
    else:
        z = right_start(observer, one)
    return run_linear(observer, v, z)


def run_linear(
    observer: LinearObserver, v: NDArray[np.float64], z: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Estimates (T, n) and residuals (T, p) for what is received, v (T, m + p), from the state z before it."""
    driven, states = v @ observer.B.T, np.empty((len(v), observer.order))
    for step, push in enumerate(driven):
        states[step] = z
        z = observer.A @ z + push
    return states @ observer.M.T + v @ observer.D.T, states @ observer.H.T + v @ observer.J.T


def _run(
    observer: Observer, one: Experiment, start: Callable[[Experiment], Vector] | None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Estimates and residuals of all samples, sample by sample."""
    state = start(one) if start is not None else observer.init(tuple(one.u[0]), tuple(one.y[0]))
    estimates, residuals = [], []
    for u, y in zip(one.u, one.y, strict=True):
        state, out = observer.step(state, tuple(u), tuple(y))
        estimates.append([float(value) for value in out.estimate])
        residuals.append([float(value) for value in out.residual])
    return np.array(estimates).reshape(len(one.y), -1), np.array(residuals).reshape(len(one.y), -1)
