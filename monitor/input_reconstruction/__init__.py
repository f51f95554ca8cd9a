"""Unknown inputs reconstructed from outputs alone (Shi, Lian and Jones: UIE)."""

from monitor.input_reconstruction.applied import applied_as_inputs
from monitor.input_reconstruction.attacks import with_attack
from monitor.input_reconstruction.designing import CLOSED_LOOP, OPEN_LOOP, Fit, InputOptions, design
from monitor.input_reconstruction.realisation import Gains, impose, realise
from monitor.input_reconstruction.report import InputDesign, InputReport
from monitor.input_reconstruction.solving import Poles

__all__ = [
    "CLOSED_LOOP",
    "OPEN_LOOP",
    "Fit",
    "Gains",
    "InputDesign",
    "InputOptions",
    "InputReport",
    "Poles",
    "applied_as_inputs",
    "design",
    "impose",
    "realise",
    "with_attack",
]
