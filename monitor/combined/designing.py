"""From histories and settings to everything that the monitor of one DGU runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from monitor import detectors, local
from monitor.combined.dgu_monitor import DguMonitor
from monitor.combined.plausibility import PlausibilityTest, build_limits
from monitor.combined.response import Response
from monitor.errors import MonitorError
from monitor.local.module import LocalModule
from monitor.options import within

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from monitor.detectors import Detector
    from monitor.history import History
    from monitor.input_estimators import EstimatorDesign
    from monitor.link_design import LinkDesign
    from monitor.local import LocalDesign

Named = tuple[str, "Mapping[str, object]"]
_VOLTAGE = 0  # component of y that is the bus voltage


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalPlan:
    """What the local module is told besides data.

    Attributes:
        decay: largest modulus of the observer's eigenvalues.
        load_sec: time in which the nominal load is learned [s].
        load_range_a: an unexplained current within it is no alarm [A].
        detector: name of the detector on its residual, with its options.
    """

    decay: float
    load_sec: float
    load_range_a: float
    detector: Named


@dataclass(frozen=True, slots=True, kw_only=True)
class CombinedPlan:
    """What the monitor of a DGU is told besides data.

    Attributes:
        observer: name of the observers' design method, with its options.
        detector: name of the detector on their residuals, with its options.
        sampling_period_sec: T_s.
        local: the local module, None: there is none.
        estimator: name of the input estimators' design method, with its options; None: no plausibility test.
        limits: options of the limits of what is plausible.
        quiet_sec: time without an accusation after which a link is heard again [s]; None: no link is ever left out.
    """

    observer: Named
    detector: Named
    sampling_period_sec: float
    local: LocalPlan | None = None
    estimator: Named | None = None
    limits: Mapping[str, object]
    quiet_sec: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class CombinedDesign:
    """Everything designed for one DGU, now or elsewhere.

    Attributes:
        links: the observer of each incoming link.
        inputs: the input estimator of each incoming link; none without a plausibility test.
        local: the observer of the own state, if there is a local module.
    """

    links: tuple[LinkDesign, ...]
    inputs: tuple[EstimatorDesign, ...] = ()
    local: LocalDesign | None = None

    def monitor(self, plan: CombinedPlan) -> DguMonitor:
        """Put what one DGU's monitor runs together; a part whose design is refused stays REFUSED and accuses nobody.

        Raises:
            MonitorError: unknown kind or option.
        """
        period = plan.sampling_period_sec
        module = None
        with within("detector"):
            built = [detectors.build(*plan.detector, period) for _ in self.links]
            links = tuple([one.monitor(detector) for one, detector in zip(self.links, built, strict=True)])
        if plan.local is not None and self.local is not None:
            with within("local", "detector"):
                local_detector = _local_detector(plan.local, period)
            module = LocalModule(
                design=self.local,
                detector=local_detector,
                learn_steps=max(0, round(plan.local.load_sec / period) - 1),  # the first sample has none before it
                load_range=plan.local.load_range_a,
            )
        with within("plausibility", "limits"):
            limits = build_limits(plan.limits, period)
        return DguMonitor(
            links=links,
            inputs=tuple(
                [PlausibilityTest(estimator=one.estimator, limits=limits, channels=one.channels) for one in self.inputs]
            ),
            local=module,
            response=None if plan.quiet_sec is None else Response(quiet_steps=round(plan.quiet_sec / period)),
        )


def design_own(plan: LocalPlan, links: Sequence[LinkDesign], own: History) -> LocalDesign:
    """Design the module of the own state.

    Args:
        plan: what it is told.
        links: the observers of the incoming links, by ascending source: they say what is received.
        own: the DGU's own history.

    Raises:
        MonitorError: wrong option.
    """
    options = {"decay": plan.decay, "load_sec": plan.load_sec, "load_range_a": plan.load_range_a}
    for number, link in enumerate(links):
        if link.channels is not None and _VOLTAGE not in link.channels:
            return local.refused(f"neighbour {number + 1} does not send its voltage")
    return local.design(own, len(links), options)


def _local_detector(plan: LocalPlan, sampling_period_sec: float) -> Detector[Any]:
    """The detector on the own residual; one that bounds it by the noise alone would forget the unknown load."""
    kind, options = plan.detector
    inner: object = options
    while kind == "n_of_m" and isinstance(inner, dict):
        kind, inner = str(inner.get("kind")), inner.get("options", {})
    if kind == "noise_bound":
        raise MonitorError("local: detector noise_bound does not know of the own load, expected another kind")
    return detectors.build(*plan.detector, sampling_period_sec)
