"""A finished observer on data that nobody has shown it, from the true plant: is its error what its own dynamics leave?

A right observer's error obeys z+ = A z alone, whatever u and d do. So errors and residuals of a whole run must be
[M; H] A^t z_0 for some z_0, and A must be Schur: then they die out. What no z_0 explains is wrong.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from monitor.constant_input import ConstantInput
from monitor.observers import LinearObserver

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from tests.fuzz.plants import Plant
    from tests.fuzz.recordings import Recording

    Floats = NDArray[np.float64]

_GROWTH = 1e6  # of an unstable plant within a run
_STEPS = 12  # of a run, at least


class Runner(Protocol):
    """What observers and input estimators have in common."""

    def __call__(self, u: Floats, y: Floats) -> tuple[Floats, Floats]:
        """Estimates (T, k) and residuals (T, p) of a run."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Misfit:
    """What is wrong on fresh data, relative to the largest signal.

    Attributes:
        estimate: of the estimated signal, 0 when none is estimated.
        residual: of the residual.
        radius: spectral radius of the error dynamics.
        judged: there were samples enough to tell.
    """

    estimate: float
    residual: float
    radius: float
    judged: bool

    @property
    def worst(self) -> float:
        """Of estimate and residual."""
        return max(self.estimate, self.residual)


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """A fresh run in natural units."""

    u: Floats
    d: Floats
    y: Floats
    x: Floats


def fresh_run(plant: Plant, recording: Recording, generator: np.random.Generator, steps: int, *, full: bool) -> Run:
    """A run with inputs as in the record, or (`full`) with every unknown input as large as the largest."""
    n, m, m_d, _ = plant.sizes
    longest = int(np.log(_GROWTH) / np.log(plant.radius)) if plant.radius > 1.0 + 1e-6 else steps
    steps = max(min(steps, longest), 4)
    size = np.ones(m_d) if full else recording.size
    u = recording.known * generator.uniform(-1.0, 1.0, (steps, m))
    d = recording.mean + size * generator.uniform(-1.0, 1.0, (steps, m_d))
    y, x = plant.run(generator.uniform(-1.0, 1.0, n), u, d)
    return Run(u=u, d=d, y=y, x=x)


def linear_of(observer: object) -> LinearObserver:
    """The matrices of an observer, without the constant input that some have."""
    inner = observer.inner if isinstance(observer, ConstantInput) else observer
    assert isinstance(inner, LinearObserver), type(inner)
    return inner


def steps_for(observer: LinearObserver, columns: int, memory: int) -> int:
    """Length of a run that tells three times more than the unknown z_0 has components."""
    return memory + observer.lag + max(_STEPS, (3 * observer.order + 20) // max(columns, 1))


def outputs_of(run: Callable[..., tuple[Sequence[float], Sequence[float]]], start: object, rows: Floats) -> Floats:
    """Step something over the rows of a table."""
    state, found = start, []
    for row in rows.tolist():
        state, out = run(state, row)
        found.append([float(value) for value in out])
    return np.array(found)


def misfit(
    observer: LinearObserver, error: Floats, residual: Floats, skipped: int, scales: tuple[Floats, Floats]
) -> Misfit:
    """What of errors (T, k) and residuals (T, p) no z_0 explains.

    Args:
        observer: its A, M and H are those of the error.
        error: estimate minus truth.
        residual: likewise.
        skipped: first steps, in which its memory is older than the run.
        scales: (k,) and (p,), what counts as 1 in errors and residuals.
    """
    k, p = error.shape[1], residual.shape[1]
    radius = float(np.max(np.abs(np.linalg.eigvals(observer.A)), initial=0.0))
    rows = np.vstack([observer.M[:k] / scales[0][:, None], observer.H / scales[1][:, None]])
    seen = np.hstack([error / scales[0], residual / scales[1]])[skipped:]
    if not np.isfinite(seen).all():
        return Misfit(estimate=np.inf, residual=np.inf, radius=radius, judged=True)
    if seen.size < observer.order + k + p:
        return Misfit(estimate=0.0, residual=0.0, radius=radius, judged=False)
    rest = seen
    if observer.order:
        free = [rows]
        for _ in range(len(seen) - 1):
            free.append(free[-1] @ observer.A)
        responses = np.vstack(free)
        size = np.max(np.abs(responses), axis=0)
        responses = responses / np.where(size > 0.0, size, 1.0)
        z = np.linalg.lstsq(responses, seen.ravel(), rcond=1e-13)[0]
        rest = (seen.ravel() - responses @ z).reshape(seen.shape)
    rounded = np.finfo(float).eps * (1.0 + _row_sum(observer.A)) * np.max(np.abs(seen), initial=0.0)
    worst = np.maximum(np.max(np.abs(rest), axis=0, initial=0.0) - rounded, 0.0)  # of a step of what dies out
    return Misfit(
        estimate=float(np.max(worst[:k], initial=0.0)),
        residual=float(np.max(worst[k:], initial=0.0)),
        radius=radius,
        judged=True,
    )


def _row_sum(A: Floats) -> float:
    """Norm for the largest entry of a vector; 0 for an empty matrix, of which numpy before 2 knows no norm."""
    return float(np.max(np.sum(np.abs(A), axis=1), initial=0.0))
