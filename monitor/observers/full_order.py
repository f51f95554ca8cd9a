"""T's data-driven unknown-input observer of full order: T (13)-(16), all solutions after Disaro and Valcher."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from monitor.linear_observer import LinearObserver
from monitor.observers.designing import DesignOptions, Shape, design_uio
from monitor.observers.predicting import predicting_observer
from monitor.options import parse_options

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from monitor.acceptor import Acceptors
    from monitor.behaviour import Behaviour
    from monitor.history import History
    from monitor.observer import Design

KIND = "full_order"
_RANK = 1e-9  # relative: sensors that show the same differ by rounding only


def design(history: History, options: Mapping[str, object]) -> Design:
    """Design xhat_t+1 = W [u_t; y_t; xhat_t; u_t+1; y_t+1], T (16), in the state form T (14)."""
    return design_uio(history, parse_options(DesignOptions, options, KIND), _SHAPE)


def _selection(behaviour: Behaviour) -> NDArray[np.float64]:
    """Every state is estimated."""
    return np.eye(behaviour.C.shape[1])


def _observer(behaviour: Behaviour, acceptors: Acceptors, W: NDArray[np.float64]) -> LinearObserver:
    """T (14): A = W_x, D = W_f, B = W_p + W_x W_f; the residual is r = y - C xhat - D_y u.

    Where unknown inputs reach y directly that is no residual, and the prediction error of y takes its place.
    """
    m, p, n = acceptors.regression.widths
    if len(behaviour.undisturbed) < p:
        return predicting_observer(behaviour, acceptors, W, list(range(n)), [])
    W_p, A, D = np.split(W, [m + p, m + p + n], axis=1)
    C = behaviour.C
    static = np.hstack([-behaviour.D, np.eye(p)])  # y - D_y u from v = (u, y)
    return LinearObserver(
        A=A,
        B=W_p + A @ D,
        M=np.eye(n),
        D=D,
        H=-C,
        J=static - C @ D,
        Z=np.linalg.pinv(C, rcond=_RANK) @ static - D,
        inputs=m,
        outputs=p,
    )


_SHAPE = Shape(kind=KIND, selection=_selection, observer=_observer)
