"""Unknown-input observer of reduced order, for outputs that show only part of the state.

Reduced-order UIO paper, (4) and (14)-(19): only the states x1 that y does not fix are integrated. Its y - C xhat is
zero by construction, so the residual is the one-step prediction error of y in the directions that no unknown input
reaches. There are p - m_d of them: with p = m_d such an observer is blind. Outputs with feedthrough, y = C x + D u, and
outputs that unknown inputs reach directly, y = C x + D u + G d, go the same way on the recorded data: x2 then follows
from the combinations of outputs without G d.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from monitor.observers.designing import DesignOptions, Shape, design_uio
from monitor.observers.predicting import predicting_observer
from monitor.options import parse_options

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from monitor.acceptor import Acceptors
    from monitor.behaviour import Behaviour
    from monitor.history import History
    from monitor.linear_observer import LinearObserver
    from monitor.observer import Design

KIND = "reduced_order"
_RANK = 1e-9  # relative: rounding in C
_CARRIES = 1e-2  # the last columns of C serve as C2 unless they carry less than this share of what C carries


def design(history: History, options: Mapping[str, object]) -> Design:
    """Design z+ = A z + B_u u + B_y y, xhat1 = z + D y, xhat2 = C2^+ (y - C1 xhat1)."""
    return design_uio(history, parse_options(DesignOptions, options, KIND), _SHAPE)


def split_states(C: NDArray[np.float64], error: float = 0.0) -> tuple[list[int], list[int]]:
    """States x1 to integrate and states x2 that y fixes once x1 is known: y = C1 x1 + C2 x2, C2 of full column rank.

    The paper's order (C2 the last columns) is kept where that C2 carries as much as C; else columns are permuted.

    Args:
        C: (p, n).
        error: how wrong C may be, in the 2-norm.
    """
    n = C.shape[1]
    values = np.linalg.svd(C, compute_uv=False)
    rank = int(np.count_nonzero(values > max(_RANK * float(np.max(values, initial=0.0)), error)))
    if not rank:
        return list(range(n)), []
    last = np.linalg.svd(C[:, n - rank :], compute_uv=False)
    if last[-1] >= _CARRIES * values[rank - 1]:
        fixed = list(range(n - rank, n))
    else:
        from scipy.linalg import qr  # noqa: PLC0415 (slow to import)

        fixed = sorted(int(column) for column in qr(C, pivoting=True)[2][:rank])
    return [state for state in range(n) if state not in fixed], fixed


def _split(behaviour: Behaviour) -> tuple[list[int], list[int]]:
    return split_states(behaviour.undisturbed @ behaviour.C, behaviour.C_error)


def _selection(behaviour: Behaviour) -> NDArray[np.float64]:
    """Rows that pick x1."""
    free, _ = _split(behaviour)
    return np.eye(behaviour.C.shape[1])[free]


def _observer(behaviour: Behaviour, acceptors: Acceptors, W: NDArray[np.float64]) -> LinearObserver:
    """(16)-(19) with the prediction error's memory s appended to the state: z = [z1; s]."""
    free, fixed = _split(behaviour)
    return predicting_observer(behaviour, acceptors, W, free, fixed)


_SHAPE = Shape(kind=KIND, selection=_selection, observer=_observer)
