"""Monitors that know nothing but data: histories, observers designed from them, detectors, measures."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from monitor.certificate import Certificate
    from monitor.errors import HistoryError, MonitorError
    from monitor.history import DataMatrices, Experiment, History, data_matrices
    from monitor.link_monitor import LinkMonitor, MonitorOutput, MonitorState

__all__ = [
    "Certificate",
    "DataMatrices",
    "Experiment",
    "History",
    "HistoryError",
    "LinkMonitor",
    "MonitorError",
    "MonitorOutput",
    "MonitorState",
    "data_matrices",
]

_NAMES = {
    "monitor.certificate": ("Certificate",),
    "monitor.errors": ("HistoryError", "MonitorError"),
    "monitor.history": ("DataMatrices", "Experiment", "History", "data_matrices"),
    "monitor.link_monitor": ("LinkMonitor", "MonitorOutput", "MonitorState"),
}
_WHERE = {name: module for module, names in _NAMES.items() for name in names}

if not TYPE_CHECKING:  # a type checker shall know the names, and no others

    def __getattr__(name: str) -> object:
        """Import a name when it is first asked for: whoever wants one part does not wait for all (PEP 562)."""
        if name not in _WHERE:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(_WHERE[name]), name)
