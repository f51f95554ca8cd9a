"""Model-based observers, for comparison only: the data-driven path may not import them."""

from monitor.baselines.identify import identified, identify_then_design
from monitor.baselines.kalman import kalman
from monitor.baselines.luenberger import luenberger
from monitor.baselines.model import Model
from monitor.baselines.uio import UioGains, decoupling_gains, model_based_uio

__all__ = [
    "Model",
    "UioGains",
    "decoupling_gains",
    "identified",
    "identify_then_design",
    "kalman",
    "luenberger",
    "model_based_uio",
]
