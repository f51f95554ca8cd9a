"""How large an attack is: the falsification itself, reconstructed from what was received, with its uncertainty.

Every trajectory of the plant can be the effect of loads and references, so p outputs and m_d unknown inputs leave
p - m_d falsified outputs that can be told apart from them. Two answers, each with its assumption:

- `under_hypothesis`: only one named output is false; loads and references may do whatever they like.
- `with_calm_inputs`: any output may be false; loads and references stay as they were before, within their spread.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import nan
from typing import TYPE_CHECKING

import numpy as np

from monitor.delayed import Goal
from monitor.delayed.known_inputs import KnownInputOptions, design_known
from monitor.errors import HistoryError
from monitor.history import data_matrices
from monitor.input_estimators.linear_estimator import LinearInputEstimator
from monitor.regression import regress_states

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.history import History
    from monitor.input_estimators import InputEstimator

_SIGMAS = 2.0
_LONGEST = 10_000  # samples within which an estimator forgets
_GONE = 1e-20  # share of the power from which on a response adds nothing


@dataclass(frozen=True, slots=True, kw_only=True)
class Spans:
    """Which steps are compared.

    Attributes:
        calm: [start, stop) without attack, as far as anyone can tell.
        attack: [start, stop) to be measured.
    """

    calm: tuple[int, int]
    attack: tuple[int, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class Hypothesis:
    """What was falsified if one output alone was.

    Attributes:
        channel: position of the output in the received vector.
        verdict: of the design; the numbers are NaN when it was refused.
        attack: (steps,) phi_k at its own instant k, NaN where it is not known.
        inputs: (steps, m_d) d_k likewise.
        magnitude: mean phi over the attack minus the calm mean, units of the output.
        uncertainty: two standard deviations of a single phi_k over the calm span: noise and the design's own error.
        noise_gain: standard deviation of phi_k under white noise of standard deviation 1 on every output.
        change: (m_d,) how far the mean inputs moved from calm to attack under this hypothesis.
    """

    channel: int
    verdict: str
    attack: NDArray[np.float64]
    inputs: NDArray[np.float64]
    magnitude: float
    uncertainty: float
    noise_gain: float
    change: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Vector:
    """What was falsified if loads and references stayed as they were.

    Attributes:
        magnitude: (p,) mean phi over the first samples of the attack, units of y.
        uncertainty: (p,) two standard deviations, from the calm spread of the reconstructed inputs through the model.
        samples: how many samples the mean is over.
    """

    magnitude: NDArray[np.float64]
    uncertainty: NDArray[np.float64]
    samples: int


def reconstruct(
    estimator: InputEstimator, received: NDArray[np.float64], delivered: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Inputs (steps, m_d) at their own instants, NaN for the last `lag` steps and around samples that are missing.

    Args:
        estimator: the estimator.
        received: (steps, p) the outputs that it needs.
        delivered: (steps,).
    """
    found = np.full((len(received), estimator.inputs), np.nan)
    usable = delivered & np.isfinite(received).all(axis=1)
    state = None
    for step, y in enumerate(received):
        if not usable[step]:
            state = None
            continue
        sample = tuple(y.tolist())
        state, found[step] = estimator.step(estimator.init(sample) if state is None else state, sample)
    return _earlier(found, estimator.lag)


def noise_response(estimator: InputEstimator) -> NDArray[np.float64]:
    """Standard deviations (m_d, p) of every reconstructed input for white noise of deviation 1 on one output alone.

    From the response to an impulse on a quiet line; what the estimator says without any impulse is taken off.
    """
    p, quiet = estimator.outputs, (0.0,) * estimator.outputs
    states = [estimator.init(quiet) for _ in range(p + 1)]
    power = np.zeros((estimator.inputs, p))
    for step in range(_LONGEST):
        answers = []
        for output in range(p + 1):
            y = tuple(1.0 if step == 0 and one == output else 0.0 for one in range(p))
            states[output], found = estimator.step(states[output], y)
            answers.append(np.asarray(found, dtype=np.float64))
        added = (np.array(answers[:p]) - answers[p]).T ** 2
        power = power + added
        if step > p and np.max(added) <= _GONE * np.max(power):
            break
    return np.sqrt(power)


def under_hypothesis(
    history: History, channel: int, received: NDArray[np.float64], delivered: NDArray[np.bool_], spans: Spans
) -> Hypothesis:
    """Reconstruct the falsification of one output next to arbitrary inputs, one step late.

    Args:
        history: of the outputs that are sent, with d.
        channel: position of the output among those that are sent.
        received: (steps, p) the outputs that are sent.
        delivered: (steps,).
        spans: what to compare.
    """
    count = history.experiments[0].d.shape[1]
    gain, phi, inputs = nan, np.full(len(received), np.nan), np.full((len(received), count), np.nan)
    try:
        made = design_known(history, KnownInputOptions(attacked=(channel,), goal=Goal.EXACT))
        verdict = made.design.verdict
        if made.observer is not None:
            both = reconstruct(LinearInputEstimator(realisation=made.observer, lag=1), received, delivered)
            phi, inputs = both[:, count], both[:, :count]
            gain = float(np.sqrt(made.noise_gain[count, count]))
    except HistoryError as error:
        verdict = f"refused: {error}"
    calm, attacked = slice(*spans.calm), slice(*spans.attack)
    return Hypothesis(
        channel=channel,
        verdict=verdict,
        attack=phi,
        inputs=inputs,
        magnitude=_mean(phi[attacked]) - _mean(phi[calm]),
        uncertainty=_SIGMAS * _spread(phi[calm]),
        noise_gain=gain,
        change=np.array([_mean(one[attacked]) - _mean(one[calm]) for one in inputs.T]),
    )


def with_calm_inputs(
    history: History, inputs: NDArray[np.float64], received: NDArray[np.float64], spans: Spans, samples: int
) -> Vector:
    """Compare what is received with the plant running on under its calm inputs; all n states must be sent.

    Args:
        history: with d and y = x.
        inputs: (steps, m_d) inputs as reconstructed.
        received: (steps, p).
        spans: what to compare; the model starts from the last sample of the calm span.
        samples: how many samples of the attack to use: the inputs will not stay for ever.

    Raises:
        HistoryError: the history does not determine the plant, or some state is not sent.
    """
    n, count = history.states, inputs.shape[1]
    data = data_matrices(history)
    if data.Y_p.shape != data.X_p.shape or np.linalg.norm(data.Y_p - data.X_p) > 1e-6 * np.linalg.norm(data.X_p):
        raise HistoryError(f"{history.outputs} outputs of {n} states are sent, expected all states")
    names = [*(f"x[{row}]" for row in range(n)), *(f"d[{row}]" for row in range(count))]
    Theta = regress_states(history, [(one.d,) for one in history.experiments], names).Theta
    A, E = Theta[:, :n], Theta[:, n:]
    calm = inputs[slice(*spans.calm)]
    calm = calm[np.isfinite(calm).all(axis=1)]
    if len(calm) <= count:
        raise HistoryError(f"{len(calm)} calm samples, expected more: give an earlier start")
    mean, covariance = calm.mean(axis=0), np.atleast_2d(np.cov(calm.T))
    x, P, G = received[spans.calm[1] - 1], np.zeros((n, n)), np.zeros_like(E)
    misfits, variances = [], []
    for step in range(spans.calm[1], min(spans.attack[0] + samples, spans.attack[1])):
        x, P, G = A @ x + E @ mean, A @ P @ A.T + E @ covariance @ E.T, A @ G + E
        if step >= spans.attack[0] and np.isfinite(received[step]).all():
            misfits.append(received[step] - x)
            # inputs that vary from sample to sample, or that stay off their mean: whichever moves the state more
            variances.append(np.maximum(np.diag(P), np.diag(G @ covariance @ G.T)))
    if not misfits:
        raise HistoryError("no sample of the attack was received")
    return Vector(
        magnitude=np.mean(misfits, axis=0),
        uncertainty=_SIGMAS * np.sqrt(np.mean(variances, axis=0)),
        samples=len(misfits),
    )


def _earlier(values: NDArray[np.float64], lag: int) -> NDArray[np.float64]:
    """Row k holds what was found at step k + lag."""
    moved = np.full_like(values, nan)
    moved[: len(values) - lag] = values[lag:]
    return moved


def _mean(values: NDArray[np.float64]) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else nan


def _spread(values: NDArray[np.float64]) -> float:
    known = values[np.isfinite(values)]
    return float(known.std(ddof=1)) if known.size > 1 else nan
