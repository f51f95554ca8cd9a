"""One level for each component of a residual, and what exceeds them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, TypeAlias

from pydantic import Field

from monitor.errors import OptionError

if TYPE_CHECKING:
    from monitor.linear import Flag, Vector

Divisor: TypeAlias = Annotated[float, Field(ge=1e-100)]
"""A level that can be divided by, and so can its square."""


def levels_of(owner: str, name: str, given: tuple[float, ...] | float, outputs: int) -> tuple[float, ...]:
    """Return a level for each of `outputs` components, from one number for all or one each.

    Raises:
        OptionError: another number of components.
    """
    values = given if isinstance(given, tuple) else (given,)
    levels = values * outputs if len(values) == 1 else values
    if len(levels) != outputs:
        line = f"{owner}: {name} has {len(levels)} components, expected 1 or {outputs}"
        raise OptionError(line, ("options", name), given, f"expected one number, or {outputs}: one an output")
    return levels


def any_above(magnitude: Vector, threshold: Vector) -> Flag:
    """Whether any component exceeds its threshold; NaN exceeds nothing and is exceeded by nothing."""
    above: Flag = False
    for value, limit in zip(magnitude, threshold, strict=True):
        above = above | (value > limit)
    return above
