"""dhat from outputs and recorded inputs alone (I): op-UIE and cl-UIE, no states in the history needed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from monitor.input_estimators.linear_estimator import LinearInputEstimator
from monitor.input_estimators.protocol import EstimatorDesign, figures
from monitor.input_reconstruction import CLOSED_LOOP, OPEN_LOOP, applied_as_inputs
from monitor.input_reconstruction import design as design_inputs

if TYPE_CHECKING:
    from collections.abc import Mapping

    from monitor.history import History


def design_open_loop(history: History, options: Mapping[str, object]) -> EstimatorDesign:
    """z+ = A_op z + B_op d_y, dhat = U1 z + Y1 d_y (theory section 6), `future` - 1 steps late.

    Raises:
        MonitorError: unknown option.
    """
    return _design(OPEN_LOOP, history, options)


def design_closed_loop(history: History, options: Mapping[str, object]) -> EstimatorDesign:
    """The same with z corrected by L (y_t-1 - yhat_t-1), which forgets a wrong start faster.

    Raises:
        MonitorError: unknown option.
    """
    return _design(CLOSED_LOOP, history, options)


def _design(kind: str, history: History, options: Mapping[str, object]) -> EstimatorDesign:
    made = design_inputs(kind, applied_as_inputs(history), options)
    if made.observer is None:
        return EstimatorDesign(kind=kind, estimator=None, verdict=made.verdict)
    zeros, proof = made.report.zeros, made.certificate.proof
    return EstimatorDesign(
        kind=kind,
        estimator=LinearInputEstimator(realisation=made.observer, lag=made.observer.lag),
        verdict=made.verdict,
        numbers={
            "misfit": made.report.fit,
            "visibility": made.report.visibility,
            "rank": made.report.rank,
            "order": made.report.order,
            "zeros": None if zeros is None else [[float(zero.real), float(zero.imag)] for zero in zeros],
            "noise_gain": np.asarray(made.report.uncertainty(1.0)).tolist(),
            "proof": None if proof is None else figures(proof),
        },
    )
