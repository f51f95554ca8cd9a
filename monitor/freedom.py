"""Ways to use the freedom Q in W = W0 + Q N: a registry of strategies."""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from monitor.acceptor import Acceptors


class Strategy(Enum):
    """How Q is chosen."""

    MINIMUM_NORM = "minimum_norm"


def choose(acceptors: Acceptors, strategy: Strategy) -> NDArray[np.float64]:
    """Solution W (k, s) that the strategy picks."""
    return STRATEGIES[strategy](acceptors)


def minimum_norm(acceptors: Acceptors) -> NDArray[np.float64]:
    """T's observer: Q = 0, the pseudo-inverse solution (14)."""
    return acceptors.W0


STRATEGIES: dict[Strategy, Callable[[Acceptors], NDArray[np.float64]]] = {Strategy.MINIMUM_NORM: minimum_norm}
