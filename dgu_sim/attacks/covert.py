"""A replica of the victim speaks in its place."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, TypeAlias

from pydantic import Field

from dgu_sim.attacks.context import AttackContext
from dgu_sim.attacks.protocol import Attack
from dgu_sim.linear import Component, FloatArray, Vector
from dgu_sim.model import Number
from dgu_sim.records import Sample

__all__ = ["Covert"]

_Rows: TypeAlias = tuple[tuple[float, ...], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Replica:
    """One victim's copy.

    Attributes:
        A: Rows of A.
        E: Rows of E.
        inverse: Rows of the left inverse of E.
        seen: The last sample before it speaks; None at first.
        x: State of the copy, once it speaks.
        d: Input of the copy [A, V], once it speaks.
    """

    A: _Rows
    E: _Rows
    inverse: _Rows
    seen: Vector | None = None
    x: Vector | None = None
    d: Vector = (0.0, 0.0)


class Covert(Attack):
    """x~+ = A x~ + E d~ replaces the victim's output: every sample fits the victim's dynamics.

    The first two samples pass unchanged. They give the copy its state and, as d = E^+ (y_k0+1 - A y_k0), the input of
    that moment, which is then held with [load_a, reference_v] added. From there on the true DGU is not heard any more.
    """

    knows: ClassVar[str] = "the victim's model"
    whole_output: ClassVar[bool] = True

    load_a: Number = Field(default=0.0, description="Invented change of the copy's load current [A].")
    reference_v: Number = Field(default=0.0, description="Invented change of the copy's voltage reference [V].")

    def init(self, context: AttackContext) -> object:
        """Return the copies, still silent."""
        return tuple(_silent(*context.knowledge.model(link.source)) for link in context.links)

    def step(self, state: object, samples: Sequence[Sample]) -> tuple[object, tuple[Sample, ...]]:
        """Return the samples as long as the copies learn, then theirs."""
        assert isinstance(state, tuple)  # noqa: S101 - what init returned
        moved = tuple(self._advance(one, sample) for one, sample in zip(state, samples, strict=True))
        return moved, tuple(
            sample if one.x is None else Sample(y=one.x) for one, sample in zip(moved, samples, strict=True)
        )

    def _advance(self, one: _Replica, sample: Sample) -> _Replica:
        if one.seen is None:
            return replace(one, seen=sample.y)
        if one.x is None:
            free = _times(one.A, one.seen)
            current, voltage = _times(one.inverse, [y - a for y, a in zip(sample.y, free, strict=True)])
            return replace(one, x=sample.y, d=(current + self.load_a, voltage + self.reference_v))
        forced = _times(one.E, one.d)
        return replace(one, x=tuple([a + e for a, e in zip(_times(one.A, one.x), forced, strict=True)]))


def _silent(A: FloatArray, E: FloatArray) -> _Replica:
    """Return the copy of a model, with E^+ = (E'E)^-1 E' written out: BLAS rounds differently elsewhere."""
    first, second = E[:, 0].tolist(), E[:, 1].tolist()
    a, b, c = _dot(first, first), _dot(first, second), _dot(second, second)
    determinant = a * c - b * b
    inverse = (
        tuple((c * x - b * y) / determinant for x, y in zip(first, second, strict=True)),
        tuple((a * y - b * x) / determinant for x, y in zip(first, second, strict=True)),
    )
    return _Replica(A=_rows(A), E=_rows(E), inverse=inverse)


def _dot(x: Sequence[float], y: Sequence[float]) -> float:
    return float(x[0] * y[0] + x[1] * y[1] + x[2] * y[2])


def _rows(matrix: FloatArray) -> _Rows:
    return tuple(tuple(row) for row in matrix.tolist())


def _times(rows: _Rows, vector: Vector) -> tuple[Component, ...]:
    product: list[Component] = []
    for row in rows:
        total: Component = 0.0
        for coefficient, component in zip(row, vector, strict=True):
            total = total + coefficient * component
        product.append(total)
    return tuple(product)
