"""dhat one step late, from two consecutive state estimates."""

from __future__ import annotations

from dataclasses import field
from typing import TYPE_CHECKING

import numpy as np
from pydantic import ConfigDict
from pydantic.dataclasses import dataclass as checked_dataclass

from monitor import observers
from monitor.errors import HistoryError
from monitor.input_estimators.linear_estimator import LinearInputEstimator
from monitor.input_estimators.protocol import EstimatorDesign
from monitor.observers.linear_observer import LinearObserver
from monitor.options import parse_options
from monitor.regression import regress_states

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from monitor.history import History

KIND = "one_step"
_DEPENDENT = 1e-8  # relative: columns of E closer than this to one another are the same


@checked_dataclass(frozen=True, slots=True, kw_only=True, config=ConfigDict(extra="forbid"))
class OneStepOptions:
    """Options of the one-step estimator.

    Attributes:
        observer: design method of the observer that gives xhat.
        observer_options: its options.
    """

    observer: str = "full_order"
    observer_options: dict[str, object] = field(default_factory=dict)


def design(history: History, options: Mapping[str, object]) -> EstimatorDesign:
    """dhat_(t-1) = E^+ (xhat_t - A xhat_(t-1)), A (n, n) and E (n, m_d) from x_t+1 = A x_t + E d_t on the history.

    Exact on exact data (theory section 7 with the UIO's xhat): for every trajectory of the plant, and so for every
    falsification that looks like one, dhat is the input that would have caused it.

    Raises:
        HistoryError: the history does not determine A and E, or no observer gives xhat.
        MonitorError: unknown option.
    """
    parsed = parse_options(OneStepOptions, options, KIND)
    if history.inputs:
        raise HistoryError(f"{history.inputs} known inputs, expected none: a link carries none")
    n, m_d = history.states, history.experiments[0].d.shape[1]
    names = [*(f"x[{row}]" for row in range(n)), *(f"d[{row}]" for row in range(m_d))]
    fit = regress_states(history, [(one.d,) for one in history.experiments], names)
    A, E = fit.Theta[:, :n], fit.Theta[:, n:]
    values = np.linalg.svd(E, compute_uv=False)
    if m_d > n or values[-1] <= _DEPENDENT * values[0]:
        raise HistoryError(f"rank E < {m_d}: the unknown inputs cannot be told apart from the state")
    found = observers.design(parsed.observer, history, parsed.observer_options)
    if not isinstance(found.observer, LinearObserver):
        raise HistoryError(f"xhat is needed: {found.verdict}")
    F = np.asarray(np.linalg.pinv(E), dtype=np.float64)
    noise = np.linalg.norm(F, axis=1) * np.sqrt(1.0 + np.linalg.norm(A, 2) ** 2)
    return EstimatorDesign(
        kind=KIND,
        estimator=LinearInputEstimator(realisation=_realise(found.observer, A, F), lag=1),
        verdict=f"accepted: {m_d} unknown inputs, one step late; misfit {fit.misfit:.2g} over {fit.columns} columns",
        numbers={
            "A": A.tolist(),
            "E": E.tolist(),
            "misfit": fit.misfit,
            "excitation": fit.excitation.tolist(),
            "noise_gain": noise.tolist(),
        },
    )


def _realise(observer: LinearObserver, A: NDArray[np.float64], F: NDArray[np.float64]) -> LinearObserver:
    """State [z; xhat_(t-1)]: dhat = F (M z + D y - A xhat_(t-1)); starts with xhat_(-1) = the first guess."""
    q, n = observer.order, observer.states
    first = observer.M @ observer.Z + observer.D
    return LinearObserver(
        A=np.block([[observer.A, np.zeros((q, n))], [observer.M, np.zeros((n, n))]]),
        B=np.vstack([observer.B, observer.D]),
        M=np.hstack([F @ observer.M, -F @ A]),
        D=F @ observer.D,
        H=np.hstack([observer.H, np.zeros((observer.outputs, n))]),
        J=observer.J,
        Z=np.vstack([observer.Z, first]),
        inputs=0,
        outputs=observer.outputs,
    )
