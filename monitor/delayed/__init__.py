"""Delayed unknown-input observers with guaranteed performance (Chakrabarty et al.), model-based and from data alone."""

from monitor.certificate import Guarantee
from monitor.constant_input import ConstantInput
from monitor.delayed.data_driven import KIND, HistoryOptions, design
from monitor.delayed.designing import DelayedOptions, Goal
from monitor.delayed.model import Model, model_of
from monitor.delayed.report import DelayedDesign

__all__ = [
    "KIND",
    "ConstantInput",
    "DelayedDesign",
    "DelayedOptions",
    "Goal",
    "Guarantee",
    "HistoryOptions",
    "Model",
    "design",
    "model_of",
]
