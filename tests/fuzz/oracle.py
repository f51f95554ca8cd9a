"""What is possible, independently: rank conditions and zeros of the true plant, excitation of the true record."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import null_space

from tests.fuzz.zeros import zero_margins

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tests.fuzz.plants import Plant
    from tests.fuzz.recordings import Recording

    Floats = NDArray[np.float64]

_ZERO = 1e-10  # a margin below it is none
_CLEAR = 1e-6  # zeros this close to the circle, and ranks this close to failing, are borderline
_SAFETY = 1e4  # of what the data leave open: a margin below this much of it is borderline
_TOLD = 1e-6  # relative error of a plant found from the data at which everything is told
UNCLEAR = 1e-5  # relative error that makes any answer borderline
_UNTOLD = 1e-1  # at which nothing is


class Answer(Enum):
    """Whether an observer exists and the data show it."""

    YES = "possible"
    NO = "impossible"
    OPEN = "borderline"
    UNTOLD = "not to be told from these data"


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """What an honest design can say.

    Attributes:
        answer: whether it must find an observer, must refuse, or may do either.
        doubt: relative error with which the data determine the plant, amplified by how close to impossible it is.
        why: in words.
        structure: what the plant alone says, whatever the data.
    """

    answer: Answer
    doubt: float
    why: str
    structure: Answer = Answer.YES


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """How well the record determines the plant.

    Attributes:
        error: relative error that rounding or noise leaves.
        spare: columns beyond what the trajectories span.
        span: dimensions that they span.
    """

    error: float
    spare: int
    span: int


def effective(plant: Plant) -> tuple[Floats, Floats, Floats]:
    """E and G of as many independent inputs as there are, and T with d_effective = T d."""
    stacked = np.vstack([plant.E, plant.G])
    if not stacked.shape[1]:
        return plant.E, plant.G, np.eye(0)
    left, values, right = np.linalg.svd(stacked, full_matrices=False)
    rank = int(np.count_nonzero(values > 1e-9 * max(values[0], 1.0)))
    if rank == stacked.shape[1]:
        return plant.E, plant.G, np.eye(rank)
    whole = left[:, :rank] * values[:rank]
    return whole[: len(plant.A)], whole[len(plant.A) :], right[:rank]


def evidence(plant: Plant, recording: Recording) -> Evidence:
    """Rank and spread of [u_t; x_t; u_t+1; d_t] (and d_t+1 where it shows at once) over the true record."""
    E, G, T = effective(plant)
    direct = bool(np.any(G))
    regressors, unknown, following = [], [], []
    for (u, x, d), whole in zip(recording.tables, recording.whole, strict=False):
        pairs = whole[:-1] & whole[1:]
        e = d @ T.T
        regressors.append(np.hstack([u[:-1], x[:-1], u[1:]])[pairs])
        unknown.append((np.hstack([e[:-1], e[1:]]) if direct else e[:-1])[pairs])
        following.append(x[1:][pairs])
    R, W, F = np.vstack(regressors).T, np.vstack(unknown).T, np.vstack(following).T
    span, columns = len(R) + len(W), R.shape[1]
    if columns < span:
        return Evidence(error=1.0, spare=columns - span, span=span)
    joint = _balanced(np.vstack([R, W]))
    values = np.linalg.svd(joint, compute_uv=False)
    excited = float(values[-1] / values[0])
    moved = _moved(R, W, (E, G, plant.C), F, direct=direct)
    spread = float(np.min(np.std(F, axis=1)))
    error = recording.error / max(spread, 1e-300) if recording.quality == "noise" else recording.error
    return Evidence(error=error / max(min(excited, moved), 1e-300), spare=columns - span, span=span)


def _balanced(rows: Floats) -> Floats:
    size = np.sqrt(np.mean(rows**2, axis=1, keepdims=True))
    return np.divide(rows, size, out=np.zeros_like(rows), where=size > 0.0)


def _moved(R: Floats, W: Floats, maps: tuple[Floats, Floats, Floats], F: Floats, *, direct: bool) -> float:
    """Weakest independent motion that the unknown inputs cause, relative to how the states move."""
    E, G, C = maps
    if not len(W) or not E.size:
        return 1.0
    right = np.linalg.svd(_balanced(R), full_matrices=False)[2] if len(R) else np.zeros((0, W.shape[1]))
    rest = W - (W @ right.T) @ right
    caused = E
    if direct:
        zero = np.zeros_like(E)
        caused = np.block([[E, zero], [G, np.zeros_like(G)], [C @ E, G]])
    rank = int(np.linalg.matrix_rank(caused, tol=1e-9 * max(1.0, float(np.linalg.norm(caused, 2)))))
    if not rank:
        return 1.0
    values = np.linalg.svd(caused @ rest, compute_uv=False)
    return float(values[rank - 1] / max(float(np.linalg.norm(F, 2)), 1e-300))


def kernel_margin(plant: Plant, delay: int, *, inputs: bool = False) -> float:
    """Smallest effect, on the outputs at t … t + delay, of a d_t that moves the state by 1 (of a d_t of size 1).

    Whatever the later inputs do; 0 when it can hide: rank Gamma_delta - rank Gamma_delta-1 < rank [E; G].
    """
    E, G, _ = effective(plant)
    q = E.shape[1]
    if not q:
        return 1.0
    powers = [E]
    for _ in range(delay):
        powers.append(plant.A @ powers[-1])
    response = [G, *(plant.C @ power for power in powers[:delay])]
    first = np.vstack(response)
    zero = np.zeros_like(G)
    later = [np.vstack([zero] * shift + response[: delay + 1 - shift]) for shift in range(1, delay + 1)]
    scale = max(1.0, float(np.linalg.norm(first, 2)))
    target = np.eye(q) if inputs else E
    still = null_space(target, rcond=1e-10)
    hiding = np.hstack([*later, first @ still])
    left, values, _ = np.linalg.svd(hiding, full_matrices=True)
    count = int(np.count_nonzero(values > 1e-9 * max(values[0], 1.0))) if values.size else 0
    free = left[:, count:].T
    basis = np.linalg.svd(target)[0][:, : np.linalg.matrix_rank(target, tol=1e-10)]
    if not basis.shape[1]:
        return 1.0
    seen = free @ first @ np.linalg.pinv(target) @ basis
    if len(seen) < basis.shape[1]:
        return 0.0
    return float(np.linalg.svd(seen, compute_uv=False)[-1]) / scale


def observer_truth(plant: Plant, data: Evidence, *, delay: int, radius: float, decouple: bool = True) -> Truth:
    """Whether an unknown-input observer with `delay` exists whose fixed modes lie within `radius`.

    Args:
        plant: the true one.
        data: what the record shows of it.
        delay: samples waited for; 1 for an observer that uses y_t and y_t+1.
        radius: of the circle.
        decouple: unknown inputs must not matter; else detectability is enough.
    """
    E, G, _ = effective(plant)
    if decouple:
        kernel = kernel_margin(plant, delay)
        zeros = zero_margins(plant.A, E, plant.C, G, radius)
    else:
        kernel = 1.0
        zeros = zero_margins(plant.A, E[:, :0], plant.C, G[:, :0], radius)
    if kernel < _ZERO:
        return judged_margin(data, Answer.NO, 1.0, "an unknown input hides from the outputs")
    if zeros.outside < _ZERO and zeros.circle > max(_SAFETY * data.error, 1e-8):
        return judged_margin(data, Answer.NO, zeros.circle, "a zero lies outside the circle")
    margin = min(kernel, zeros.least)
    return judged_margin(data, Answer.YES, margin, f"margins: kernel {kernel:.1e}, zeros {zeros.least:.1e}")


def judged_margin(data: Evidence, answer: Answer, margin: float, why: str) -> Truth:
    """Weigh what the plant says against what the data leave open."""
    doubt = data.error / max(margin, 1e-300)
    told = f"{why}; data leave {data.error:.0e}, {data.spare} spare columns"
    if data.spare < 0 or data.error > _UNTOLD:
        return Truth(answer=Answer.UNTOLD, doubt=1.0, why=f"the data do not tell: {told}", structure=answer)
    if data.spare < data.span + 10 or data.error > _TOLD or margin < max(_CLEAR, _SAFETY * data.error):
        return Truth(answer=Answer.OPEN, doubt=min(doubt, 1.0), why=f"borderline: {told}", structure=answer)
    return Truth(answer=answer, doubt=doubt, why=told, structure=answer)
