"""dhat one step late, from two consecutive state estimates."""

from __future__ import annotations

from dataclasses import field, replace
from typing import TYPE_CHECKING

import numpy as np
from pydantic.dataclasses import dataclass as checked_dataclass

from monitor import observers
from monitor.behaviour import identify_direct
from monitor.delayed.known_inputs import check_acting
from monitor.errors import HistoryError
from monitor.input_estimators.linear_estimator import LinearInputEstimator
from monitor.input_estimators.protocol import EstimatorDesign, figures
from monitor.linear_observer import LinearObserver
from monitor.options import STRICT, parse_options
from monitor.proof import SIGMAS, Trial, hold_back, prove, rounding, stretches
from monitor.proof import noise as noise_of
from monitor.regression import regress_states
from monitor.scaling import norms, spreads
from monitor.sight import noise_covariance
from monitor.trials import right_start, run_linear

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    from monitor.history import Experiment, History
    from monitor.proof import Proof, Split
    from monitor.regression import Fit
    from monitor.scaling import Scaling

KIND = "one_step"
_EXACT = 1e-9  # relative: a history that misses the plant by less carries rounding only
_ROUNDING = 1e-10  # relative rounding of exact samples
_SHORTEST = 3  # samples of a stretch that can be judged
_WORTHLESS = 1.0  # spreads: an estimate with a larger error is no better than the mean of the history


@checked_dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class OneStepOptions:
    """Options of the one-step estimator.

    Attributes:
        observer: design method of the observer that gives xhat.
        observer_options: its options.
    """

    observer: str = "full_order"
    observer_options: dict[str, object] = field(default_factory=dict)


def design(history: History, options: Mapping[str, object]) -> EstimatorDesign:
    """dhat_(t-1) = [E; G]^+ [xhat_t - A xhat_(t-1); y_(t-1) - C xhat_(t-1)] from x_t+1 = A x_t + E d_t, y = C x + G d.

    A (n, n), E (n, m_d), C (p, n), G (p, m_d) are fitted to the history.

    Exact on exact data (theory section 7 with the UIO's xhat): for every trajectory of the plant, and so for every
    falsification that looks like one, dhat is the input that would have caused it.

    Raises:
        HistoryError: the history does not determine A and E, or no observer gives xhat.
        MonitorError: unknown option.
    """
    parsed = parse_options(OneStepOptions, options, KIND)
    if history.inputs:
        raise HistoryError(f"{history.inputs} known inputs, expected none: a link carries none")
    n, m_d = history.states, history.experiments[0].d.shape[1]
    split = hold_back(history)
    spread = spreads(split.seen)
    norm = norms(split.seen, spread)
    seen, into = norm.scaled(split.seen), spread.relative_to(norm)
    names = [*(f"x[{row}]" for row in range(n)), *(f"d[{row}]" for row in range(m_d))]
    fit = regress_states(seen, [(one.d,) for one in seen.experiments], names)
    A, E = fit.Theta[:, :n], fit.Theta[:, n:]
    C, G = identify_direct(seen)
    check_acting(np.vstack([E / into.x[:, None], G / into.y[:, None]]) * into.d)
    found = observers.design(parsed.observer, history, parsed.observer_options)
    if not isinstance(found.observer, LinearObserver):
        raise HistoryError(f"xhat is needed: {found.verdict}")
    observer = found.observer
    if observer.lag:
        raise HistoryError(f"xhat of the same sample is needed, {parsed.observer} gives it {observer.lag} late")
    reads = [row for row in range(len(G)) if G[row].any()]  # outputs that inputs act on directly
    inverse = norm.d[:, None] * np.linalg.pinv(np.vstack([E, G[reads]]))
    F, F_y = inverse[:, :n] / norm.x, inverse[:, n:] / norm.y[reads]
    A, E = norm.x[:, None] * A / norm.x, norm.x[:, None] * E / norm.d
    C = (norm.y[:, None] * C / norm.x)[reads]
    realisation = _realise(observer, A, F)
    if reads:
        realisation = _reading(realisation, F_y, C, reads)
    proof = _prove(realisation, lambda one: _start(observer, one, reads), (split, spread), fit)
    if not proof.holds:
        raise HistoryError(proof.refusal())
    noise = np.linalg.norm(F, axis=1) * np.sqrt(1.0 + np.linalg.norm(A, 2) ** 2)
    misfit = f"misfit {fit.misfit:.2g} over {fit.columns} columns"
    return EstimatorDesign(
        kind=KIND,
        estimator=LinearInputEstimator(realisation=realisation, lag=1),
        verdict=f"accepted: {m_d} unknown inputs, one step late; {misfit}; {proof.words()}",
        numbers={
            "A": A.tolist(),
            "E": E.tolist(),
            "misfit": fit.misfit,
            "excitation": fit.excitation.tolist(),
            "noise_gain": noise.tolist(),
            "proof": figures(proof),
        },
    )


def _start(observer: LinearObserver, one: Experiment, reads: list[int]) -> NDArray[np.float64]:
    """State after the first sample of a stretch: the observer starts where the recorded state puts it."""
    later = replace(one, **{name: getattr(one, name)[1:] for name in ("u", "y", "x", "d", "w")})
    return np.concatenate([right_start(observer, later), one.x[0], one.y[0, reads]])


def _prove(
    realisation: LinearObserver,
    start: Callable[[Experiment], NDArray[np.float64]],
    data: tuple[Split, Scaling],
    fit: Fit,
) -> Proof:
    """Hold dhat against the recorded d in unseen samples, each stretch from its right start."""
    split, spread = data

    def tried(history: History) -> list[Trial]:
        trials = []
        for one in stretches(history):
            if len(one.y) < _SHORTEST or not np.isfinite(one.d).all():
                continue
            estimate, _ = run_linear(realisation, one.y[1:], start(one))
            size = max(float(np.max(np.abs(one.d / spread.d))), float(np.max(np.abs(one.x / spread.x))))
            error = (estimate - one.d[:-1]) / spread.d
            trials.append(Trial(error=error, residual=np.zeros((len(error), 0)), size=size))
        return trials

    unseen, rows = tried(split.unseen), realisation.states
    covariance = noise_covariance(realisation, np.diag(spread.y**2))[:rows, :rows]
    gain = float(np.sqrt(np.max(np.diag(covariance) / spread.d**2, initial=0.0)))
    allowed, unknowns = rounding(_ROUNDING, gain, unseen), fit.Theta.shape[1]
    if fit.misfit > _EXACT:
        allowed = noise_of(tried(split.seen), unknowns, allowed)
        allowed = replace(allowed, error=np.minimum(allowed.error, _WORTHLESS))
    scales = (spread.d, np.zeros(0))
    hardly = SIGMAS * fit.doubt
    return prove(unseen, allowed, scales, spare_columns=fit.columns - unknowns, estimate="inputs", hardly=hardly)


def _realise(observer: LinearObserver, A: NDArray[np.float64], F: NDArray[np.float64]) -> LinearObserver:
    """State [z; xhat_(t-1)]: dhat = F (M z + D y - A xhat_(t-1)); starts with xhat_(-1) = the first guess."""
    q, n = observer.order, observer.states
    first = observer.M @ observer.Z + observer.D
    return LinearObserver(
        A=np.block([[observer.A, np.zeros((q, n))], [observer.M, np.zeros((n, n))]]),
        B=np.vstack([observer.B, observer.D]),
        M=np.hstack([F @ observer.M, -F @ A]),
        D=F @ observer.D,
        H=np.hstack([observer.H, np.zeros((observer.outputs, n))]),
        J=observer.J,
        Z=np.vstack([observer.Z, first]),
        inputs=0,
        outputs=observer.outputs,
    )


def _reading(
    found: LinearObserver, F_y: NDArray[np.float64], C: NDArray[np.float64], reads: list[int]
) -> LinearObserver:
    """State [z; xhat_(t-1); y_(t-1)] of the outputs `reads`: dhat gains F_y (y_(t-1) - C xhat_(t-1))."""
    q, n, r = found.order, C.shape[1], len(reads)
    picked = np.eye(found.outputs)[reads]
    M = found.M.copy()
    M[:, q - n :] -= F_y @ C
    return replace(
        found,
        A=np.block([[found.A, np.zeros((q, r))], [np.zeros((r, q + r))]]),
        B=np.vstack([found.B, picked]),
        M=np.hstack([M, F_y]),
        H=np.hstack([found.H, np.zeros((found.outputs, r))]),
        Z=np.vstack([found.Z, picked]),
    )
