"""What a reconstruction design knows about itself, and the design as a value."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from monitor.observer import Design

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.certificate import Certificate
    from monitor.linear_observer import LinearObserver


@dataclass(frozen=True, slots=True, kw_only=True)
class InputReport:
    """What the record showed and how well inputs can be told from it; parts that were never reached are None.

    Attributes:
        past: N_ini, samples of past inputs and outputs.
        delay: steps by which the reconstructed input lags the newest output, future - 1.
        columns: windows used.
        dropped: windows left out because of missing values.
        order: order of the plant as the record shows it, None when noise hides it.
        rank: rank of [U_p; u_t; Y].
        rank_basis: what the ranks rest on.
        visibility: smallest singular value of H on the orthonormal trajectories; condition (8) of I fails at 0.
        noise: first singular value dropped over last one kept, 0 for exact data.
        fit: |u_t - [U1 Y1] H| / |u_t| over the record.
        zeros: invariant zeros that the record shows, complex; the best possible spectral radius is the largest modulus.
        noise_gain: (m, m) steady covariance of the input estimate under white noise of unit covariance on y.
    """

    past: int
    delay: int
    columns: int
    dropped: int
    order: int | None = None
    rank: int | None = None
    rank_basis: str = ""
    visibility: float | None = None
    noise: float | None = None
    fit: float | None = None
    zeros: NDArray[np.complex128] | None = None
    noise_gain: NDArray[np.float64] | None = None

    def lines(self) -> list[str]:
        """The report as lines of text for a terminal."""
        rank = "undecided" if self.rank is None else f"{self.rank} (order {self.order})"
        windows = f"{self.columns} windows, {self.dropped} dropped"
        sized = f"{self.past} samples past, {self.delay} steps late; {windows}"
        lines = [f"inputs: {sized}; rank {rank}, {self.rank_basis or 'not reached'}"]
        if self.visibility is not None:
            zeros = "none" if self.zeros is None or not len(self.zeros) else ", ".join(f"{z:.4g}" for z in self.zeros)
            lines.append(f"existence: visibility {self.visibility:.3g}, invariant zeros {zeros}")
        if self.noise_gain is not None and self.fit is not None:
            spread = ", ".join(f"{one:.3g}" for one in self.uncertainty(1.0))
            lines.append(f"reconstructed inputs: misfit {self.fit:.2g}; standard deviations under unit noise {spread}")
        return lines

    def uncertainty(self, noise_std: float) -> NDArray[np.float64]:
        """Standard deviation (m,) of every reconstructed input for white noise of this deviation on every output.

        Exact for a design on exact data; the misfit of a design on noisy data (`fit`) comes on top.
        """
        if self.noise_gain is None:
            return np.full(0, np.nan)
        return np.asarray(noise_std * np.sqrt(np.diag(self.noise_gain)))


@dataclass(frozen=True, slots=True, kw_only=True)
class InputDesign:
    """The estimator of unknown inputs designed from a record, or the reason why there is none.

    Attributes:
        kind: name of the method.
        observer: estimate = the m reconstructed inputs at t - delay, residual = p outputs at t - delay - 1 minus their
            prediction; None when refused.
        certificate: dynamics and residual like those of any other observer.
        report: what only input reconstruction knows.
    """

    kind: str
    observer: LinearObserver | None
    certificate: Certificate
    report: InputReport

    @property
    def accepted(self) -> bool:
        """Whether there is an estimator."""
        return self.observer is not None

    @property
    def verdict(self) -> str:
        """One line in plain words."""
        return self.certificate.verdict

    def as_design(self) -> Design:
        """Same design under the one observer protocol, as a link monitor takes it."""
        return Design(kind=self.kind, observer=self.observer, certificate=self.certificate)
