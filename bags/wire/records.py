"""What the messages of varying occasion say, as frozen data.

The per-step messages carry records of `dgu_sim` and `monitor`; these here are the ones that nobody else owns.
"""

import json
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from dgu_sim.grid import Link

GRID = 0
"""Number of the whole grid where DGUs are numbered from 1."""


class DiagnosticLevel(IntEnum):
    """The levels of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmRecord:
    """An alarm on the link source -> monitor starts (active) or ends.

    Attributes:
        step: Step at which the detector's verdict changed.
        source: Number of the watched DGU.
        monitor: Number of the DGU that hosts the monitor.
        active: True: the alarm starts; false: it ends.
        residual: r at this step, 3 components [V, A, V s].
        threshold: Threshold at this step, 3 components [V, A, V s].
    """

    step: int
    source: int
    monitor: int
    active: bool
    residual: tuple[float, ...]
    threshold: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamRecord:
    """A fault of the stream of messages on the link source -> monitor appears (active) or is over.

    Attributes:
        step: Step at which it does.
        source: Number of the DGU that the stream claims to come from.
        monitor: Number of the DGU that listens.
        kind: One of `monitor.stream_guard.StreamFault`.
        active: True: from this step on; false: this step is in order again.
        detail: In words.
    """

    step: int
    source: int
    monitor: int
    kind: str
    active: bool
    detail: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SecondRecord:
    """A message of a second publisher on a link, in order with its step.

    Attributes:
        step: The step it claims.
        link: The link.
        y: What it says, 3 components [V, A, V s].
        delivered: False: it says that the link lost the sample.
    """

    step: int
    link: Link
    y: tuple[float, ...]
    delivered: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class HistoryRecord:
    """One offline experiment on one DGU.

    Attributes:
        dgu: Number of the DGU.
        experiment: Number of this experiment, from 0.
        experiments: How many experiments the whole history has.
        sampling_period_sec: T_s [s].
        u: Known inputs, shape (T, m), SI units.
        y: Outputs, shape (T, p) [V, A, V s].
        x: States, shape (T, n) [V, A, V s].
        d: Inputs applied that are unknown online, shape (T, 2) or (T, 0): I_net + I_L [A], V_ref + alpha [V].
        w: What only the DGU itself measures, shape (T, 1 + neighbours) or (T, 0): I_L [A], then the bus voltages of its
            neighbours, ascending [V].
    """

    dgu: int
    experiment: int
    experiments: int
    sampling_period_sec: float
    u: NDArray[np.float64]
    y: NDArray[np.float64]
    x: NDArray[np.float64]
    d: NDArray[np.float64]
    w: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignRecord:
    """The observer designed for the link source -> monitor, or why there is none.

    Attributes:
        source: Number of the watched DGU.
        monitor: Number of the DGU that hosts the monitor.
        observer: Name of the design method.
        accepted: False: refused, the link is not monitored.
        verdict: In words.
        certificate: JSON document.
    """

    source: int
    monitor: int
    observer: str
    accepted: bool
    verdict: str
    certificate: str

    @property
    def lag(self) -> int:
        """Steps by which the estimates of the monitor lag: at step k they are of step k - lag."""
        try:
            certificate = json.loads(self.certificate)
        except ValueError:
            return 0  # a bag of someone else
        return int(certificate.get("lag", 0)) if isinstance(certificate, dict) else 0
