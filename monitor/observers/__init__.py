"""Observers and the registry of design methods: one file and one line here for a new one."""

from monitor.linear_observer import LinearObserver
from monitor.observer import Design, Estimate, Observer
from monitor.observers.registry import KINDS, design

__all__ = ["KINDS", "Design", "Estimate", "LinearObserver", "Observer", "design"]
