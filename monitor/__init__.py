"""Monitors that know nothing but data: histories, observers designed from them, detectors, metrics."""

from monitor.certificate import Certificate
from monitor.errors import HistoryError, MonitorError
from monitor.history import DataMatrices, Experiment, History, data_matrices
from monitor.link_monitor import LinkMonitor, MonitorOutput, MonitorState
from monitor.metrics import LinkMetrics, link_metrics

__all__ = [
    "Certificate",
    "DataMatrices",
    "Experiment",
    "History",
    "HistoryError",
    "LinkMetrics",
    "LinkMonitor",
    "MonitorError",
    "MonitorOutput",
    "MonitorState",
    "data_matrices",
    "link_metrics",
]
