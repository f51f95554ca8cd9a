"""Baseline, model-based: the delayed observer of C from known matrices. Nothing data-driven may import it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from monitor.backstop import guarded
from monitor.delayed.designing import DelayedOptions, design_for, refuse
from monitor.options import parse_options

if TYPE_CHECKING:
    from collections.abc import Mapping

    from monitor.delayed.model import Model
    from monitor.delayed.report import DelayedDesign

KIND = "delayed_model_based"


def design_from_model(model: Model, options: Mapping[str, object], sampling_period_sec: float) -> DelayedDesign:
    """Design C's observer for known A, B, C, D; a refusal is a value.

    Raises:
        MonitorError: an option that does not fit.
    """
    chosen = parse_options(DelayedOptions, options, KIND)
    return guarded(
        lambda: design_for(KIND, model, chosen, sampling_period_sec, unit="an unknown input of norm 1"),
        lambda reason: refuse(KIND, reason),
    )
