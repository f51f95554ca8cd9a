"""From histories and settings to everything that the monitor of one DGU runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from monitor import detectors, input_estimators, local, observers
from monitor.combined.dgu_monitor import DguMonitor
from monitor.combined.plausibility import PlausibilityTest, build_limits
from monitor.combined.response import Response
from monitor.errors import MonitorError
from monitor.link_monitor import LinkMonitor
from monitor.local.module import LocalModule

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from monitor.detectors import Detector
    from monitor.history import History
    from monitor.input_estimators import EstimatorDesign
    from monitor.local import LocalDesign
    from monitor.observers import Design

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
    """Everything designed for one DGU.

    Attributes:
        monitor: what runs.
        links: the observer of each incoming link.
        inputs: the input estimator of each incoming link; none without a plausibility test.
        local: the observer of the own state, if there is a local module.
    """

    monitor: DguMonitor
    links: tuple[Design, ...]
    inputs: tuple[EstimatorDesign, ...]
    local: LocalDesign | None


def design(plan: CombinedPlan, neighbours: Sequence[History], own: History | None) -> CombinedDesign:
    """Design what one DGU's monitor runs; a part whose design is refused stays REFUSED and accuses nobody.

    Args:
        plan: what to run.
        neighbours: the history of the source of each incoming link, ascending.
        own: the DGU's own history; needed by the local module alone.

    Raises:
        MonitorError: unknown kind or option.
    """
    links = tuple([observers.design(plan.observer[0], history, plan.observer[1]) for history in neighbours])
    inputs = () if plan.estimator is None else _estimators(plan.estimator, neighbours)
    own_design = None if plan.local is None or own is None else _local(plan.local, links, own)
    period = plan.sampling_period_sec
    module = None
    if plan.local is not None and own_design is not None:
        module = LocalModule(
            design=own_design,
            detector=_local_detector(plan.local, period),
            learn_steps=max(0, round(plan.local.load_sec / period) - 1),  # the first sample has none before it
            load_range=plan.local.load_range_a,
        )
    limits = build_limits(plan.limits, period)
    monitor = DguMonitor(
        links=tuple([_link(one, detectors.build(*plan.detector, period)) for one in links]),
        inputs=tuple(
            [PlausibilityTest(estimator=one.estimator, limits=limits, channels=one.channels) for one in inputs]
        ),
        local=module,
        response=None if plan.quiet_sec is None else Response(quiet_steps=round(plan.quiet_sec / period)),
    )
    return CombinedDesign(monitor=monitor, links=links, inputs=inputs, local=own_design)


def _link(design: Design, detector: Detector[Any]) -> LinkMonitor:
    return LinkMonitor(observer=design.observer, detector=detector, channels=design.channels, blind=design.blind)


def _estimators(named: Named, neighbours: Sequence[History]) -> tuple[EstimatorDesign, ...]:
    return tuple([input_estimators.design(named[0], history, named[1]) for history in neighbours])


def _local(plan: LocalPlan, links: Sequence[Design], own: History) -> LocalDesign:
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
