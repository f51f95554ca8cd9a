"""Estimators of the inputs that a DGU does not tell: load and line currents, reference; one file and one line each."""

from monitor.input_estimators.linear_estimator import LinearInputEstimator
from monitor.input_estimators.protocol import EstimatorDesign, InputEstimator
from monitor.input_estimators.registry import KINDS, carried, design

__all__ = ["KINDS", "EstimatorDesign", "InputEstimator", "LinearInputEstimator", "carried", "design"]
