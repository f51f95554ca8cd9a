"""Identify-then-design: fit a model to the history by least squares, then build the model-based UIO of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from monitor.baselines.model import Model
from monitor.baselines.uio import decoupling_gains, model_based_uio
from monitor.behaviour import identify_output
from monitor.history import data_matrices

if TYPE_CHECKING:
    from monitor.history import History
    from monitor.linear_observer import LinearObserver


def identified(history: History, unknown_inputs: int) -> Model:
    """Fit [A B] = X_f [X_p; U_p]^+, E the main directions of what is left (E is unique up to a factor on its right)."""
    data = data_matrices(history)
    n = len(data.X_p)
    known = np.vstack([data.X_p, data.U_p])
    fitted = data.X_f @ np.linalg.pinv(known)
    left = np.linalg.svd(data.X_f - fitted @ known, full_matrices=False)[0]
    return Model(A=fitted[:, :n], B=fitted[:, n:], E=left[:, :unknown_inputs], C=identify_output(data))


def identify_then_design(history: History, unknown_inputs: int, decay: float) -> LinearObserver:
    """Model-based UIO of the identified model.

    Raises:
        monitor.errors.MonitorError: the identified model has rank CE < rank E.
    """
    model = identified(history, unknown_inputs)
    return model_based_uio(model, decoupling_gains(model, decay))
