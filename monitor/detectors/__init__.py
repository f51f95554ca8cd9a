"""Detectors and their registry: one file and one line for a new one."""

from monitor.detectors.protocol import BlockDetector, Detector, Phase, Verdict, matched
from monitor.detectors.registry import KINDS, attack_free_sec, build, filled_in

__all__ = ["KINDS", "BlockDetector", "Detector", "Phase", "Verdict", "attack_free_sec", "build", "filled_in", "matched"]
