"""Input estimators (I) as link monitors: what they expect of the outputs is compared with what comes.

They estimate inputs, not states, so as an observer they give no estimate: the residual y_t-delay-1 - yhat alone. The
inputs themselves are in `monitor.input_estimators`. The history must hold the applied inputs `d`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from monitor.certificate import Certificate
from monitor.input_reconstruction import CLOSED_LOOP, OPEN_LOOP, applied_as_inputs
from monitor.input_reconstruction import design as design_inputs
from monitor.observer import Design

if TYPE_CHECKING:
    from collections.abc import Mapping

    from monitor.history import History


def design_open_loop(history: History, options: Mapping[str, object]) -> Design:
    """Design op-UIE for its residual."""
    return _design(OPEN_LOOP, history, options)


def design_closed_loop(history: History, options: Mapping[str, object]) -> Design:
    """Design cl-UIE for its residual."""
    return _design(CLOSED_LOOP, history, options)


def _design(kind: str, history: History, options: Mapping[str, object]) -> Design:
    record = applied_as_inputs(history)
    if not record.inputs:
        reason = "refused: the history does not hold the inputs that were applied (d): record them in the experiment"
        return Design(kind=kind, observer=None, certificate=Certificate(kind=kind, accepted=False, verdict=reason))
    made = design_inputs(kind, record, options)
    found = made.observer
    if found is None:
        return made.as_design()
    stateless = replace(found, M=np.zeros((0, found.order)), D=np.zeros((0, found.outputs)), lag=0)
    certificate = replace(made.certificate, lag=0)
    return replace(made.as_design(), observer=stateless, certificate=certificate).unless_blind(allow=False)
