"""Samples as attacks make them."""

from collections.abc import Sequence
from math import nan

from dgu_sim.linear import Truth, Vector, add, choose
from dgu_sim.records import Sample

__all__ = ["LOST", "lost_where", "shifted"]

LOST: tuple[float, float, float] = (nan, nan, nan)
"""y of a sample that is not delivered."""


def shifted(samples: Sequence[Sample], phi: Sequence[Vector]) -> tuple[Sample, ...]:
    """Return y^c = y + phi, T (19), with one phi for each link."""
    return tuple(
        Sample(y=add(sample.y, one), delivered=sample.delivered) for sample, one in zip(samples, phi, strict=True)
    )


def lost_where(lost: Truth, sample: Sample) -> Sample:
    """Return the sample, not delivered and NaN where `lost` holds."""
    kept = (not lost) if isinstance(lost, bool) else ~lost
    y = tuple([choose(lost, missing, component) for missing, component in zip(LOST, sample.y, strict=True)])
    return Sample(y=y, delivered=sample.delivered & kept)
