"""Compiled kernels for what costs time (docs/engine.md); where none were built, numpy does the same."""

from engine.choice import NUMPY, VARIABLE, EngineError, available, chosen, described

__all__ = ["NUMPY", "VARIABLE", "EngineError", "available", "chosen", "described"]
