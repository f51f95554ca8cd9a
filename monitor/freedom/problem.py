"""What a strategy is given and what it may answer."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from monitor.acceptor import Acceptors
    from monitor.linear_observer import LinearObserver


class Strategy(Enum):
    """How Q is chosen."""

    MINIMUM_NORM = "minimum_norm"
    DUAL_LQR = "dual_lqr"
    POLE_PLACEMENT = "pole_placement"
    MAX_SENSITIVITY = "max_sensitivity"


@dataclass(frozen=True, slots=True, kw_only=True)
class FreedomOptions:
    """What may be asked of a strategy.

    Attributes:
        decay: largest modulus that the eigenvalues of A_UIO may have, None for the strategy's own default.
        poles: eigenvalues of A_UIO where they can be moved, for pole_placement; else spread below the decay.
        noise_budget: root of the summed variances of the residual under unit white noise on y, for max_sensitivity;
            None: as much as the minimum_norm observer has.
    """

    decay: float | None = None
    poles: tuple[float, ...] | None = None
    noise_budget: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """All acceptors and how one of them becomes an observer.

    Attributes:
        acceptors: W = W0 + Q N.
        build: observer of a solution W; for fixed A_UIO its B, D and J are affine in W.
    """

    acceptors: Acceptors
    build: Callable[[NDArray[np.float64]], LinearObserver]


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why a strategy has no answer, in one line."""

    reason: str
