"""What a delayed design guarantees, and the design as a value."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from monitor.observer import Design

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from monitor.certificate import Certificate, Guarantee
    from monitor.constant_input import ConstantInput
    from monitor.delayed.model import Model
    from monitor.linear_observer import LinearObserver


@dataclass(frozen=True, slots=True, kw_only=True)
class DelayedDesign:
    """The delayed observer, or the reason why there is none.

    Attributes:
        kind: name of the method.
        observer: estimates the state `guarantee.lag` steps late, None when refused.
        input_observer: the same with the unknown input, `guarantee.delay` steps late, as its estimate.
        certificate: dynamics and residual like those of any other observer.
        model: what the design rests on; from data it holds up to a change of coordinates of the unknown input.
        L: (n, (delta + 1) p) gain, None when refused.
        input_noise_gain: (q, q) steady covariance of the reconstructed input under white noise of unit covariance on y,
            None when refused; the last rows are the attacks, in units of `attack_bound`.
    """

    kind: str
    observer: LinearObserver | ConstantInput | None
    input_observer: LinearObserver | ConstantInput | None
    certificate: Certificate
    model: Model | None = None
    L: NDArray[np.float64] | None = None
    input_noise_gain: NDArray[np.float64] | None = None

    @property
    def guarantee(self) -> Guarantee | None:
        """Bounds on the error; None when refused."""
        return self.certificate.guarantee

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
