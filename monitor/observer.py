"""What every observer and every design is, whatever the method."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple, Protocol

from monitor.certificate_html import as_html
from monitor.wording import blind_reason, describe

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from monitor.batch import Estimates
    from monitor.certificate import Certificate
    from monitor.linear import Component, Vector


class Estimate(NamedTuple):
    """What an observer concludes at one step.

    Attributes:
        estimate: xhat_t-lag, n components, units of x; lag is a property of the observer.
        residual: r_t, p components, units of y; zero on every trajectory of the plant once the start has died out.
    """

    estimate: Vector
    residual: Vector


class Observer(Protocol):
    """A running observer: holds parameters only; its state is a vector of components in which NaN spreads."""

    @property
    def inputs(self) -> int:
        """Number m of known inputs."""

    @property
    def outputs(self) -> int:
        """Number p of outputs it needs."""

    @property
    def states(self) -> int:
        """Number n of states it estimates."""

    @property
    def lag(self) -> int:
        """Steps by which the estimate lags the newest sample: at step t it is of x_t-lag."""

    def init(self, u: Sequence[Component], y: Sequence[Component]) -> Vector:
        """State before the first sample is used."""

    def step(self, state: Vector, u: Sequence[Component], y: Sequence[Component]) -> tuple[Vector, Estimate]:
        """Estimate x_t-lag and the residual from the samples up to t, and advance."""


class RecordedObserver(Observer, Protocol):
    """An observer that also runs over whole recordings."""

    def run(self, u: ArrayLike | None, y: ArrayLike, x0: ArrayLike | None = None) -> Estimates:
        """Run over a whole recording: what `step` gives one by one, bit for bit; x0 is the first estimate."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """The observer designed from a history, or the reason why there is none.

    Attributes:
        kind: name of the design method.
        observer: the running observer, None when refused.
        certificate: what the data showed and what the residual can and cannot see.
        channels: positions in the received vector of the outputs that the observer was designed on.
    """

    kind: str
    observer: RecordedObserver | None
    certificate: Certificate
    channels: tuple[int, ...] | None = None

    def __repr__(self) -> str:
        """The kind and the verdict, then the page of the certificate."""
        return "\n".join(
            [f"<{self.kind} design: {self.verdict}>", *(f"  {line}" for line in describe(self.certificate)[1:])]
        )

    def _repr_html_(self) -> str:
        """For a notebook."""
        return as_html(f"{self.kind} design", self.certificate)

    @property
    def blind(self) -> bool:
        """Whether the observer's residual shows nothing."""
        report = self.certificate.residual
        return report is not None and report.blind

    @property
    def accepted(self) -> bool:
        """Whether there is an observer."""
        return self.observer is not None

    @property
    def verdict(self) -> str:
        """One line in plain words."""
        return self.certificate.verdict

    def unless_blind(self, *, allow: bool) -> Design:
        """Turn a design whose residual shows nothing into a refusal, unless it is allowed for its estimate."""
        if allow or not self.blind:
            return self
        verdict = f"refused: {blind_reason(self.certificate.data)}"
        return replace(self, observer=None, certificate=replace(self.certificate, accepted=False, verdict=verdict))
