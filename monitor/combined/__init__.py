"""Everything the monitor of one DGU can know at once: which of its incoming links lies, and which to leave out."""

from monitor.combined.designing import CombinedDesign, design_own
from monitor.combined.dgu_monitor import DguMonitor, DguOutput, DguState, DguVerdict, Own, Received
from monitor.combined.isolation import Evidence, Isolation, explains, isolate
from monitor.combined.plausibility import InputOutput, Limits, PlausibilityTest, build_limits
from monitor.combined.response import Response

__all__ = [
    "CombinedDesign",
    "DguMonitor",
    "DguOutput",
    "DguState",
    "DguVerdict",
    "Evidence",
    "InputOutput",
    "Isolation",
    "Limits",
    "Own",
    "PlausibilityTest",
    "Received",
    "Response",
    "build_limits",
    "design_own",
    "explains",
    "isolate",
]
