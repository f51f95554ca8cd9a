"""The freedom used for detection: the largest worst-case residual under a constant bias for a given noise gain."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from monitor.acceptor import unobservable
from monitor.freedom.assignment import assign, default_poles
from monitor.freedom.problem import Refusal
from monitor.kernel import null_space
from monitor.sight import accumulated

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.freedom.problem import FreedomOptions, Problem
    from monitor.linear_observer import LinearObserver

_DEFAULT_DECAY = 0.9
_VISIBLE = 1e-7  # relative: below it no choice makes a bias visible
_RANK = 1e-9  # relative: a row of N_x below is rounding
_TINY = 1e-300  # keeps 0 / 0 out


@dataclass(frozen=True, slots=True, kw_only=True)
class _Affine:
    """A matrix that is affine in the free numbers theta: base + sum_i theta_i steps[i]."""

    base: NDArray[np.float64]
    steps: NDArray[np.float64]


def max_sensitivity(problem: Problem, options: FreedomOptions) -> NDArray[np.float64] | Refusal:
    """Maximise the residual of the least visible bias, the noise gain held.

    A_UIO is fixed first, with all movable eigenvalues at `decay`: a slow residual averages noise. What is left of Q,
    the rows of N that do not touch the estimate, enters G0 = J + H (I - A)^-1 B_y (residual of a constant bias) and
    F = [J; O^(1/2) B_y] (noise, O = A' O A + H' H) affinely. With V a basis of the biases that some choice can see:

        maximise t  subject to  (V' G0 V + V' G0' V) / 2 >= t I,  |F|_F <= noise budget.

    A semidefinite programme, convex; then |G0 phi| >= t |phi| for every phi in the range of V.
    """
    fixed = _fixed_dynamics(problem, options)
    if isinstance(fixed, Refusal):
        return fixed
    base, directions = fixed
    observers = [problem.build(base), *(problem.build(base + direction) for direction in directions)]
    gains = _affine([_steady_gain(observer) for observer in observers])
    root = _root_gramian(observers[0])  # A and H are the same for all of them
    noise = _affine([_noise_factor(observer, root) for observer in observers])
    visible = _visible(gains)
    if not visible.shape[1]:
        return Refusal("max_sensitivity: no choice of Q makes any constant bias visible")
    budget = options.noise_budget
    if budget is None:
        budget = _minimum_norm_noise(problem)
    if budget is None:
        return Refusal("max_sensitivity: minimum_norm is not stable and sets no noise budget; give noise_budget")
    ball = _within(noise, budget)
    solve = _along_one if visible.shape[1] == 1 else _solve
    theta = None if ball is None else solve(gains, ball, visible)
    if isinstance(theta, Refusal):
        return theta
    if theta is None:
        return Refusal(f"max_sensitivity: no choice of Q sees every visible bias within the noise budget {budget:.3g}")
    return base + np.tensordot(theta, directions, axes=1)


def _fixed_dynamics(
    problem: Problem, options: FreedomOptions
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | Refusal:
    """A solution W with its poles at the decay, and the changes (f0 k, k, s) of W that leave A_UIO alone."""
    acceptors = problem.acceptors
    decay = _DEFAULT_DECAY if options.decay is None else options.decay
    movable = len(acceptors.W_x0) - unobservable(acceptors.W_x0, acceptors.N_x).shape[1]
    rank = int(np.linalg.matrix_rank(acceptors.N_x, tol=_RANK)) if acceptors.N_x.size else 0
    free = rank == len(acceptors.W_x0)  # every entry of A_UIO: poles may coincide
    Q = assign(acceptors, np.full(movable, decay) if free else default_poles(movable, decay))
    if Q is None:
        return Refusal("max_sensitivity: the eigenvalues cannot be placed accurately at this decay; try another")
    base = acceptors.W0 + Q @ acceptors.N
    still = null_space(acceptors.N_x.T, rcond=_RANK).T @ acceptors.N if acceptors.N_x.size else acceptors.N
    k = len(acceptors.W0)
    if not len(still) or not k:
        return Refusal("max_sensitivity: A_UIO uses up the whole freedom, nothing is left to optimise")
    directions = np.einsum("ij,fs->ifjs", np.eye(k), still).reshape(-1, k, still.shape[1])
    return base, directions


def _affine(values: list[NDArray[np.float64]]) -> _Affine:
    return _Affine(base=values[0], steps=np.array([value - values[0] for value in values[1:]]))


def _steady_gain(observer: LinearObserver) -> NDArray[np.float64]:
    """G0 (p, p)."""
    m = observer.inputs
    rest = np.linalg.solve(np.eye(observer.order) - observer.A, observer.B[:, m:])
    return np.asarray(observer.J[:, m:] + observer.H @ rest)


def _root_gramian(observer: LinearObserver) -> NDArray[np.float64]:
    """O^(1/2) (q, q) of O = A' O A + H' H."""
    values, vectors = np.linalg.eigh(accumulated(observer.A.T, observer.H.T @ observer.H))
    return np.asarray(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T)


def _noise_factor(observer: LinearObserver, root: NDArray[np.float64]) -> NDArray[np.float64]:
    """F with |F|_F^2 the summed variances of the residual under unit white noise on y."""
    m = observer.inputs
    return np.vstack([observer.J[:, m:], root @ observer.B[:, m:]])


def _visible(gains: _Affine) -> NDArray[np.float64]:
    """Orthonormal basis (p, k) of the biases that leave a steady residual for some theta."""
    stacked = np.vstack([gains.base, *gains.steps])
    _, values, right = np.linalg.svd(stacked)
    scale = max(float(values[0]), 1.0)
    return right[: int(np.count_nonzero(values > _VISIBLE * scale))].T


def _minimum_norm_noise(problem: Problem) -> float | None:
    """Noise gain of T's observer, None when it is not stable."""
    observer = problem.build(problem.acceptors.W0)
    if np.max(np.abs(np.linalg.eigvals(observer.A)), initial=0.0) >= 1.0:
        return None
    return float(np.linalg.norm(_noise_factor(observer, _root_gramian(observer))))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Ball:
    """The theta that keep the noise budget, as theta = centre + reach s with |s| <= 1."""

    centre: NDArray[np.float64]
    reach: NDArray[np.float64]


def _within(noise: _Affine, budget: float) -> _Ball | None:
    """With F = f0 + F1 theta = f_rest + U s, f_rest orthogonal to U, |F| <= budget is a ball; None: it is empty."""
    f0, F1 = noise.base.ravel(), noise.steps.reshape(len(noise.steps), -1).T
    left, values, right = np.linalg.svd(F1, full_matrices=False)
    kept = values > _VISIBLE * values[0]
    left, inverse = left[:, kept], right[kept].T / values[kept]
    at = left.T @ f0
    room = budget**2 - float(np.linalg.norm(f0 - left @ at)) ** 2
    return None if room < 0.0 else _Ball(centre=-inverse @ at, reach=np.sqrt(room) * inverse)


def _along_one(gains: _Affine, ball: _Ball, visible: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """One visible direction: a linear gain on a ball, largest along its gradient; None when t > 0 is out of reach."""
    base, *steps = (float(visible[:, 0] @ gain @ visible[:, 0]) for gain in (gains.base, *gains.steps))
    gradient = ball.reach.T @ np.array(steps)
    size = float(np.linalg.norm(gradient))
    if not size > 0.0:
        return None
    theta = ball.centre + ball.reach @ (gradient / size)
    return theta if base + float(np.array(steps) @ theta) > 0.0 else None


def _solve(gains: _Affine, ball: _Ball, visible: NDArray[np.float64]) -> NDArray[np.float64] | Refusal | None:
    """Solve the semidefinite programme in s; None when no theta gives t > 0.

    A second solver of another kind (first order) is asked where the first (interior point) gives up.
    """
    cp: Any = import_module("cvxpy")  # only this strategy pays for loading it; it has no types
    pieces = np.array([visible.T @ step @ visible for step in (gains.base, *gains.steps)])
    pieces = (pieces + np.swapaxes(pieces, 1, 2)) / 2.0
    base = pieces[0] + np.tensordot(ball.centre, pieces[1:], axes=1)
    steps = np.tensordot(ball.reach.T, pieces[1:], axes=1)
    scale = max(float(np.linalg.norm(base)), float(np.max(np.abs(steps), initial=0.0)), _TINY)
    s, t, size = cp.Variable(len(steps)), cp.Variable(), visible.shape[1]
    gain = base / scale + cp.reshape((steps / scale).reshape(len(steps), -1).T @ s, (size, size), order="C")
    programme = cp.Problem(cp.Maximize(t), [gain - t * np.eye(size) >> 0, cp.norm(s, 2) <= 1.0])
    for solver in (cp.CLARABEL, cp.SCS):
        try:
            programme.solve(solver=solver)
        except cp.error.SolverError:
            continue
        if s.value is None or t.value is None:
            continue
        theta = ball.centre + ball.reach @ (s.value / max(1.0, float(np.linalg.norm(s.value))))
        return np.asarray(theta, dtype=np.float64) if float(t.value) > _VISIBLE else None
    return Refusal("max_sensitivity: the semidefinite programme is not solved (CLARABEL and SCS give up); use dual_lqr")
