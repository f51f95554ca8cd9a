"""Detectors and their registry: one file and one line for a new one."""

from monitor.detectors.protocol import BlockDetector, Detector, Phase, Verdict, matched
from monitor.detectors.registry import KINDS, build

__all__ = ["KINDS", "BlockDetector", "Detector", "Phase", "Verdict", "build", "matched"]
