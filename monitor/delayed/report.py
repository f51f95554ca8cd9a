"""What a delayed design guarantees, and the design as a value."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from monitor.observers.protocol import Design

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from monitor.certificate import Certificate
    from monitor.delayed.model import Model
    from monitor.delayed.realisation import ConstantInput
    from monitor.observers.linear_observer import LinearObserver


@dataclass(frozen=True, slots=True, kw_only=True)
class Guarantee:
    """Bounds on the error in the limit, and how close inputs come to them; all 0 for exact decoupling.

    Attributes:
        delay: delta.
        lag: steps by which the state estimate lags the newest output, max(delta - 1, 0).
        exact: the unknown inputs are cancelled altogether.
        gained_rank: rank Gamma_delta - rank Gamma_delta-1.
        needed_rank: rank [B; D]; exact decoupling needs the two to be equal.
        a: of C's LMI.
        gamma: sqrt(mu), limsup |H e| <= gamma sup |W_k:k+delta|.
        bound: gamma sqrt(delta + 1), limsup |H e| <= bound sup |w_k|.
        response_bound: sum_l |G_l| of the impulse response, another guaranteed bound on limsup |H e| / sup |w_k|.
        reached: limsup |H e| / sup |w_k| that the worst inputs found do reach.
        input_bound: guaranteed limsup |w^ - w| / sup |w_k| of the input reconstructed delta steps late.
        unit: what |w_k| = 1 means.
    """

    delay: int
    lag: int
    exact: bool
    gained_rank: int = 0
    needed_rank: int = 0
    a: float = 0.5
    gamma: float = 0.0
    bound: float = 0.0
    response_bound: float = 0.0
    reached: float = 0.0
    input_bound: float = 0.0
    unit: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class DelayedDesign:
    """The delayed observer, or the reason why there is none.

    Attributes:
        kind: name of the method.
        observer: estimates the state `guarantee.lag` steps late, None when refused.
        input_observer: the same with the unknown input, `guarantee.delay` steps late, as its estimate.
        certificate: dynamics and residual like those of any other observer.
        guarantee: None when refused.
        model: what the design rests on; from data it holds up to a change of coordinates of the unknown input.
        L: (n, (delta + 1) p) gain, None when refused.
        input_noise_gain: (q, q) steady covariance of the reconstructed input under white noise of unit covariance on y,
            None when refused; the last rows are the attacks, in units of `attack_bound`.
    """

    kind: str
    observer: LinearObserver | ConstantInput | None
    input_observer: LinearObserver | ConstantInput | None
    certificate: Certificate
    guarantee: Guarantee | None
    model: Model | None = None
    L: NDArray[np.float64] | None = None
    input_noise_gain: NDArray[np.float64] | None = None

    @property
    def accepted(self) -> bool:
        """Whether there is an observer."""
        return self.observer is not None

    @property
    def verdict(self) -> str:
        """One line in plain words."""
        return self.certificate.verdict

    def as_design(self) -> Design:
        """Same design under the one observer protocol, as a link monitor takes it."""
        return Design(kind=self.kind, observer=self.observer, certificate=self.certificate)
