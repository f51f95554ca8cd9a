"""The strategies by name."""

from __future__ import annotations

from typing import TYPE_CHECKING

from monitor.freedom.assignment import dual_lqr, pole_placement
from monitor.freedom.max_sensitivity import max_sensitivity
from monitor.freedom.minimum_norm import minimum_norm
from monitor.freedom.problem import Strategy

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from monitor.freedom.problem import FreedomOptions, Problem, Refusal

STRATEGIES: dict[Strategy, Callable[[Problem, FreedomOptions], NDArray[np.float64] | Refusal]] = {
    Strategy.MINIMUM_NORM: minimum_norm,
    Strategy.DUAL_LQR: dual_lqr,
    Strategy.POLE_PLACEMENT: pole_placement,
    Strategy.MAX_SENSITIVITY: max_sensitivity,
}


def choose(problem: Problem, strategy: Strategy, options: FreedomOptions) -> NDArray[np.float64] | Refusal:
    """Solution W (k, s) that the strategy picks, or why there is none."""
    return STRATEGIES[strategy](problem, options)
