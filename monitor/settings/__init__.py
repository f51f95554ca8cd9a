"""What the monitors of a run are told besides data: names, options and defaults."""

from monitor.settings.parts import (
    DetectorSettings,
    EstimatorSettings,
    LimitSettings,
    LocalSettings,
    ObserverSettings,
    PlausibilitySettings,
    ResponseSettings,
)
from monitor.settings.section import MonitorSettings
from monitor.settings.team import AnnouncedInput, TeamEventKind, TeamEventSettings, TeamSettings, TeamStructure

__all__ = [
    "AnnouncedInput",
    "DetectorSettings",
    "EstimatorSettings",
    "LimitSettings",
    "LocalSettings",
    "MonitorSettings",
    "ObserverSettings",
    "PlausibilitySettings",
    "ResponseSettings",
    "TeamEventKind",
    "TeamEventSettings",
    "TeamSettings",
    "TeamStructure",
]
