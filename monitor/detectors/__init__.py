"""Detectors and their registry: one file and one line for a new one."""

from monitor.detectors.protocol import BlockDetector, Detector, Phase, Verdict, matched
from monitor.detectors.registry import KINDS, Kind, attack_free_sec, build, filled_in

__all__ = [
    "KINDS",
    "BlockDetector",
    "Detector",
    "Kind",
    "Phase",
    "Verdict",
    "attack_free_sec",
    "build",
    "filled_in",
    "matched",
]
