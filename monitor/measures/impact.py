"""What an attack did to the grid (theory, sections 2 and 9)."""

from __future__ import annotations

from dataclasses import dataclass
from math import nan
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class GridImpact:
    """How far the grid is from its goals at each step.

    Attributes:
        mean_voltage: (steps, ...) <V> - <V_ref> [V].
        voltage: (steps, ...) max_i |V_i - V_ref,i| [V].
        sharing: (steps, ...) max_i I_i/I^r_i - min_i I_i/I^r_i.
    """

    mean_voltage: NDArray[np.float64]
    voltage: NDArray[np.float64]
    sharing: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Impact:
    """Largest value of one quantity around an attack.

    Attributes:
        before: in the time before it.
        until_detection: from its start to the first alarm; to its end when nobody saw it.
        largest: from its start to its end and the aftermath.
        rate: slope of a straight line through the attack, per second; NaN when it is too short.
    """

    before: float
    until_detection: float
    largest: float
    rate: float


def grid_impact(
    voltage: NDArray[np.float64],
    current: NDArray[np.float64],
    nominal: NDArray[np.float64],
    rated: NDArray[np.float64],
) -> GridImpact:
    """Distances from the goals of secondary control.

    Args:
        voltage: (steps, ..., dgus) V [V].
        current: (steps, ..., dgus) I_t [A].
        nominal: (steps, ..., dgus) V_ref before the secondary correction [V].
        rated: (dgus,) I^r [A].
    """
    share = current / rated
    return GridImpact(
        mean_voltage=(voltage - nominal).mean(axis=-1),
        voltage=np.abs(voltage - nominal).max(axis=-1),
        sharing=share.max(axis=-1) - share.min(axis=-1),
    )


def impact_of(
    values: NDArray[np.float64],
    attack: tuple[int, int],
    alarm_step: int | None,
    sampling_period_sec: float,
    *,
    context_steps: int,
) -> Impact:
    """Largest |value| around an attack.

    Args:
        values: (steps,).
        attack: steps [start, stop).
        alarm_step: first alarm, None when missed.
        sampling_period_sec: T_s [s].
        context_steps: steps before and behind it that belong to it.
    """
    start, stop = attack
    during = values[start:stop]
    steps = np.arange(len(during)) * sampling_period_sec
    slope = float(np.polyfit(steps, during, 1)[0]) if len(during) >= 2 and np.isfinite(during).all() else nan  # noqa: PLR2004 - a line has two points
    return Impact(
        before=_largest(values[max(start - context_steps, 0) : start]),
        until_detection=_largest(values[start : stop if alarm_step is None else alarm_step + 1]),
        largest=_largest(values[start : stop + context_steps]),
        rate=slope,
    )


def _largest(values: NDArray[np.float64]) -> float:
    return float(np.fmax.reduce(np.abs(values), initial=-np.inf)) if np.isfinite(values).any() else nan
