"""T's choice: Q = 0, the pseudo-inverse solution."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from monitor.freedom.problem import FreedomOptions, Problem


def minimum_norm(problem: Problem, options: FreedomOptions) -> NDArray[np.float64]:
    """T (14) as printed; the options do not matter."""
    del options
    return problem.acceptors.W0
