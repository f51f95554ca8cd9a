"""The one relation between two samples of a DGU that no unknown input can break: all that a UIO's residual can see."""

from collections.abc import Sequence
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from dgu_sim.attacks.context import AttackContext
from dgu_sim.errors import AttackError
from dgu_sim.linear import Component, FloatArray

__all__ = ["Parity", "Source", "parities_of", "parity_of_history"]

_STATES = 3
_RELATED = 5  # n + m_d: rank of two samples in a row, x and x+ = A x + E d
_SMALLEST = 1e-6  # share of the largest entry below which a coefficient cannot be divided by


class Source(StrEnum):
    """Where the attacker knows the victim from."""

    HISTORY = "history"
    MODEL = "model"


class Parity(NamedTuple):
    """past . y_k + future . y_k+1 = 0 for every input d, theory section 3: past = -A'q, future = q, q orthogonal to E.

    Attributes:
        past: 3 components.
        future: 3 components.
    """

    past: Sequence[Component]
    future: Sequence[Component]


def parities_of(context: AttackContext, source: Source) -> tuple[Parity, ...]:
    """Return the relation of the DGU at the source of each attacked link.

    `model` computes it from A and E; `history` takes it from the data alone, as the left singular vector that belongs
    to the sixth singular value of [Y_p; Y_f] (0 for exact data: two samples in a row have rank n + m_d = 5).

    Raises:
        AttackError: Nothing is known of the grid, or the history is too short.
    """
    knowledge = context.knowledge

    def relation(dgu: int) -> Parity:
        if source is Source.MODEL:
            numbers: list[Component] = [float(value) for value in _from_model(*knowledge.model(dgu))]
        else:
            numbers = context.each_run(lambda seed: parity_of_history(knowledge.history(dgu, seed), dgu))
        return Parity(numbers[:_STATES], numbers[_STATES:])

    return tuple(relation(link.source) for link in context.links)


def _from_model(A: FloatArray, E: FloatArray) -> FloatArray:
    q = np.cross(E[:, 0], E[:, 1])
    past = -(A[0] * q[0] + A[1] * q[1] + A[2] * q[2])  # written out: BLAS rounds differently on other processors
    return _scaled(np.concatenate([past, q]))


def parity_of_history(experiments: Sequence[FloatArray], dgu: int) -> FloatArray:
    """Return past and future, shape (6,), from the states (T, 3) of each recorded experiment.

    Raises:
        AttackError: The history is too short.
    """
    pairs = np.hstack([np.vstack([y[:-1].T, y[1:].T]) for y in experiments])
    if pairs.shape[1] < _RELATED:
        raise AttackError(
            f"the recorded history of DGU {dgu} has {pairs.shape[1]} pairs of samples, expected at least {_RELATED}"
        )
    left: FloatArray = np.linalg.svd(pairs)[0]
    return _scaled(left[:, -1])


def _scaled(relation: FloatArray) -> FloatArray:
    """Return the relation with coefficient -1 of v at the later sample: it gives that v from the rest."""
    if abs(relation[-1]) < _SMALLEST * np.abs(relation).max():
        raise AttackError("the victim's v does not answer to its other states, expected a DGU with integral action")
    return np.asarray(-relation / relation[-1])
