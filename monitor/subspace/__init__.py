"""Ways to find the behaviour in noisy data: one file and one registry line for each."""

from monitor.subspace.averaging import averaged
from monitor.subspace.registry import METHODS, Method, span

__all__ = ["METHODS", "Method", "averaged", "span"]
