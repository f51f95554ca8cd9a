"""How far noise on the outputs moves what an observer estimates."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from monitor.sight import accumulated

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.linear_observer import LinearObserver


def noise_gain(observer: LinearObserver) -> NDArray[np.float64]:
    """Steady covariance of the estimate under white noise of unit covariance on every output; the observer is Schur.

    With S = A S A' + B_y B_y', the covariance is M S M' + D_y D_y'.
    """
    B_y, D_y = observer.B[:, observer.inputs :], observer.D[:, observer.inputs :]
    spread = accumulated(observer.A, B_y @ B_y.T)
    return np.asarray(D_y @ D_y.T + observer.M @ spread @ observer.M.T)
