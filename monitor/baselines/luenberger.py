"""G's Luenberger observer of the own state (Gallo et al. 2020): every input is known, one way or another."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import solve_discrete_are

from monitor.baselines.predictor import predictor

if TYPE_CHECKING:
    from monitor.baselines.model import Model
    from monitor.linear_observer import LinearObserver


def luenberger(model: Model, decay: float) -> LinearObserver:
    """Predictor z+ = A z + [B E] (u, d) + L (y - C z), xhat = z, r = y - C z; every mode within the decay.

    The known inputs are (u, d): load, reference and, from the neighbours' received outputs, the line currents.
    """
    scaled, output = model.A.T / decay, model.C.T
    X = solve_discrete_are(scaled, output, np.eye(len(model.A)), np.eye(len(model.C)))
    gain = np.linalg.solve(np.eye(len(model.C)) + model.C @ X @ output, model.C @ X @ scaled)
    return predictor(model.A, np.hstack([model.B, model.E]), model.C, np.asarray(decay * gain.T))
