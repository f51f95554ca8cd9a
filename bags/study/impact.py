"""What an attack does to the grid, before anybody notices and altogether."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from dgu_sim.scenario import Scenario


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Impact:
    """Largest deviation up to each step, from the attack's start on; shapes (steps, runs).

    Attributes:
        mean_voltage: |<V> - <V_ref>| [V].
        voltage: Largest |V_i - V_ref,i| of any DGU [V].
        sharing: Largest minus smallest I_t,i / I^r_i.
    """

    mean_voltage: NDArray[np.float64]
    voltage: NDArray[np.float64]
    sharing: NDArray[np.float64]


def impact_of(scenario: Scenario, x: NDArray[np.float64], start: int) -> Impact:
    """Return the impact over time.

    Args:
        scenario: References and rated currents.
        x: True states, shape (steps, runs, DGUs, 3).
        start: First step that counts; before it the impact is 0.
    """
    reference = np.array([one.reference_v for one in scenario.dgus])
    rated = np.array([one.rated_current_a for one in scenario.dgus])
    V, shares = x[..., 0], x[..., 1] / rated
    return Impact(
        mean_voltage=_so_far(np.abs((V - reference).mean(axis=-1)), start),
        voltage=_so_far(np.abs(V - reference).max(axis=-1), start),
        sharing=_so_far(shares.max(axis=-1) - shares.min(axis=-1), start),
    )


def _so_far(signal: NDArray[np.float64], start: int) -> NDArray[np.float64]:
    counted = signal.copy()
    counted[:start] = 0.0
    return np.asarray(np.maximum.accumulate(counted, axis=0))
