"""Everything that the monitors of a run are told."""

from pydantic import Field

from monitor.settings.base import Settings
from monitor.settings.parts import (
    DetectorSettings,
    LocalSettings,
    ObserverSettings,
    PlausibilitySettings,
    ResponseSettings,
)
from monitor.settings.team import TeamSettings

__all__ = ["MonitorSettings"]


class MonitorSettings(Settings):
    """What every DGU runs on each of its incoming links, and on all of them together."""

    observer: ObserverSettings = Field(default_factory=ObserverSettings, description="The observer.")
    detector: DetectorSettings = Field(default_factory=DetectorSettings, description="The detector.")
    team: TeamSettings | None = Field(
        default=None, description="Monitors that estimate the whole grid together; none: each watches its links alone."
    )
    local: LocalSettings | None = Field(default=None, description="The module of the own state; default: none.")
    plausibility: PlausibilitySettings | None = Field(
        default=None, description="The test of the reconstructed input of each neighbour; default: none."
    )
    response: ResponseSettings | None = Field(
        default=None, description="What a DGU does about an accused link; default: nothing."
    )

    @property
    def combined(self) -> bool:
        """Whether a DGU's monitor draws one conclusion from several tests, or acts on one."""
        return not (self.local is None and self.plausibility is None and self.response is None)

    @property
    def calibrated_sec(self) -> float:
        """Time at which an attack may start [s]: nothing learns from attack-free samples any more."""
        parts = [self.detector, self.local, self.plausibility]
        return max(part.calibrated_sec for part in parts if part is not None)
