"""From histories and settings to everything that the monitor of one DGU runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from monitor import local
from monitor.combined.dgu_monitor import DguMonitor
from monitor.combined.plausibility import PlausibilityTest, build_limits
from monitor.combined.response import Response
from monitor.errors import MonitorError
from monitor.local.module import LocalModule
from monitor.options import within

if TYPE_CHECKING:
    from collections.abc import Sequence

    from monitor.detectors import Detector
    from monitor.history import History
    from monitor.input_estimators import EstimatorDesign
    from monitor.link_design import LinkDesign
    from monitor.local import LocalDesign
    from monitor.settings import DetectorSettings, LocalSettings, MonitorSettings, PlausibilitySettings

_VOLTAGE = 0  # component of y that is the bus voltage


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

    def monitor(self, settings: MonitorSettings, sampling_period_sec: float) -> DguMonitor:
        """Put what one DGU's monitor runs together; a part whose design is refused stays REFUSED and accuses nobody.

        Args:
            settings: what it was designed for.
            sampling_period_sec: T_s [s].

        Raises:
            MonitorError: unknown kind or option.
        """
        period, response = sampling_period_sec, settings.response
        with within("detector"):
            links = tuple([one.monitor(settings.detector.build(period)) for one in self.links])
        return DguMonitor(
            links=links,
            inputs=self._tests(settings.plausibility, period),
            local=self._module(settings.local, period),
            response=None if response is None else Response(quiet_steps=round(response.quiet_sec / period)),
        )

    def _tests(self, settings: PlausibilitySettings | None, period: float) -> tuple[PlausibilityTest, ...]:
        if settings is None:
            return ()
        limits = build_limits(settings.limits.model_dump(), period)
        return tuple(
            [PlausibilityTest(estimator=one.estimator, limits=limits, channels=one.channels) for one in self.inputs]
        )

    def _module(self, settings: LocalSettings | None, period: float) -> LocalModule | None:
        if settings is None or self.local is None:
            return None
        with within("local", "detector"):
            detector = _local_detector(settings.detector, period)
        return LocalModule(
            design=self.local,
            detector=detector,
            learn_steps=max(0, round(settings.load_sec / period) - 1),  # the first sample has none before it
            load_range=settings.load_range_a,
        )


def design_own(settings: LocalSettings, links: Sequence[LinkDesign], own: History) -> LocalDesign:
    """Design the module of the own state.

    Args:
        settings: what it is told.
        links: the observers of the incoming links, by ascending source: they say what is received.
        own: the DGU's own history.
    """
    for number, link in enumerate(links):
        if link.channels is not None and _VOLTAGE not in link.channels:
            return local.refused(f"neighbour {number + 1} does not send its voltage")
    return local.design(own, len(links), settings.model_dump())


def _local_detector(settings: DetectorSettings, sampling_period_sec: float) -> Detector[Any]:
    """The detector on the own residual; one that bounds it by the noise alone would forget the unknown load."""
    kind = settings.kind
    inner: object = settings.options
    while kind == "n_of_m" and isinstance(inner, dict):
        kind, inner = str(inner.get("kind")), inner.get("options", {})
    if kind == "noise_bound":
        raise MonitorError("local: detector noise_bound does not know of the own load, expected another kind")
    return settings.build(sampling_period_sec)
