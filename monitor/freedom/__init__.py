"""Ways to use the freedom Q in W = W0 + Q N: one file and one registry line for each."""

from monitor.freedom.problem import FreedomOptions, Problem, Refusal, Strategy
from monitor.freedom.registry import STRATEGIES, choose

__all__ = ["STRATEGIES", "FreedomOptions", "Problem", "Refusal", "Strategy", "choose"]
