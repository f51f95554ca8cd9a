"""A detector overruled by hand: switched off, or another threshold in the place of its own."""

from __future__ import annotations

from math import nan
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np

from monitor.detectors.protocol import Phase
from monitor.linear import select

if TYPE_CHECKING:
    from monitor.linear import Component, Count, Flag, Vector

__all__ = ["Judging", "begun_again", "overruled"]


class Judging(NamedTuple):
    """What was said by hand about the detector of one link.

    Attributes:
        off: it judges nothing.
        threshold: alarm when |r_i| > threshold_i, one number for all components or one each; None: the detector's own.
    """

    off: bool = False
    threshold: tuple[float, ...] | None = None


def overruled(
    judging: Judging, phase: Count, alarm: Flag, residual: Vector, threshold: Vector
) -> tuple[Count, Flag, Vector]:
    """Return phase, alarm and threshold as they are told, from what the detector itself says.

    A link without a residual stays REFUSED, and one whose observer settles is not judged by hand either.

    Args:
        judging: what was said by hand.
        phase: the detector's, a number or an array.
        alarm: the detector's.
        residual: p components.
        threshold: the detector's, p components.
    """
    width = len(residual)
    if judging.off:
        nothing = cast("Flag", phase != phase)  # noqa: PLR0124 - False, or an array of it
        return _phase(nothing, phase, Phase.REFUSED), nothing, (nan,) * width
    if judging.threshold is None:
        return phase, alarm, threshold
    limits = judging.threshold * width if len(judging.threshold) == 1 else judging.threshold
    above: Flag = False
    for component, limit in zip(residual, limits, strict=True):
        above = above | (abs(component) > limit)
    waits = cast("Flag", (phase == Phase.REFUSED.value) | (phase == Phase.SETTLING.value))
    refused = cast("Flag", phase == Phase.REFUSED.value)
    told: list[Component] = [select(refused, nan, limit) for limit in limits]
    return _phase(waits, phase, Phase.ARMED), _unless(waits, above), told


def begun_again(state: Any, fresh: Any, lanes: Flag) -> Any:  # noqa: ANN401 - a detector's own state
    """Return a detector's state with that of its beginning on some lanes of its arrays.

    Args:
        state: named tuples, tuples and components, at any depth.
        fresh: what `Detector.init` returned.
        lanes: True where it begins again; a single bool for a state in floats.
    """
    if isinstance(lanes, bool):
        return fresh if lanes else state
    if isinstance(state, tuple):
        parts = [begun_again(one, other, lanes) for one, other in zip(state, fresh, strict=True)]
        return type(state)(*parts) if hasattr(state, "_fields") else tuple(parts)
    beginning = np.asarray(fresh)  # of one lane
    return np.where(lanes, beginning.reshape(*beginning.shape, *(1,) * (np.ndim(state) - beginning.ndim)), state)


def _phase(kept: Flag, phase: Count, other: Phase) -> Count:
    return cast("Count", select(kept, cast("Component", phase), other.value))


def _unless(waits: Flag, above: Flag) -> Flag:
    return cast("Flag", above & ~waits) if isinstance(waits, np.ndarray) else bool(above) and not waits
