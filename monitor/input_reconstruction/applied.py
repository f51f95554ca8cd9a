"""Histories of DGUs as records for input reconstruction: what was applied offline is what is unknown online."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from monitor.history import History


def applied_as_inputs(history: History) -> History:
    """Put the applied inputs d behind u, where input reconstruction expects the inputs that it is to find.

    A history without d and u has no input afterwards; the design says so.
    """
    experiments = (replace(one, u=np.hstack([one.u, one.d])) for one in history.experiments)
    return replace(history, experiments=tuple(experiments))
