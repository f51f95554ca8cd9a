"""dhat from the delayed observer (C): exact where the outputs allow it, with a guaranteed error bound where not."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from monitor.constant_input import ConstantInput
from monitor.delayed.known_inputs import KIND, KnownInputOptions, design_known
from monitor.input_estimators.linear_estimator import LinearInputEstimator
from monitor.input_estimators.protocol import EstimatorDesign, figures
from monitor.linear_observer import LinearObserver
from monitor.options import parse_options

if TYPE_CHECKING:
    from collections.abc import Mapping

    from monitor.history import History


def design(history: History, options: Mapping[str, object]) -> EstimatorDesign:
    """w^_k = [B; D]^+ [xhat_k+1 - A xhat_k; y_k - C xhat_k], delta steps late (theory section 7).

    With `attacked` a falsification of those outputs is estimated next to d and does not disturb dhat.

    Raises:
        HistoryError: the history does not determine A, E and C.
        MonitorError: unknown option.
    """
    found = design_known(history, parse_options(KnownInputOptions, options, KIND))
    made, count = found.design, history.experiments[0].d.shape[1]
    if found.observer is None or made.guarantee is None or found.proof is None:
        return EstimatorDesign(kind=KIND, estimator=None, verdict=made.verdict)
    guarantee = made.guarantee
    bound = guarantee.input_bound * found.reach[:count]
    late = f"{count} unknown inputs, {guarantee.delay} steps late; misfit {found.misfit:.2g}"
    promise = "exact" if guarantee.exact else f"errors up to {', '.join(f'{one:.3g}' for one in bound)} for |w| <= 1"
    return EstimatorDesign(
        kind=KIND,
        estimator=LinearInputEstimator(realisation=_first(found.observer, count), lag=guarantee.delay),
        verdict=f"accepted: {late}; {promise}; {found.proof.words()}",
        numbers={
            "misfit": found.misfit,
            "exact": guarantee.exact,
            "input_bound": bound.tolist(),
            "reach": found.reach.tolist(),
            "noise_gain": np.sqrt(np.diag(found.noise_gain)).tolist(),
            "proof": figures(found.proof),
        },
    )


def _first(observer: LinearObserver | ConstantInput, count: int) -> LinearObserver | ConstantInput:
    """The same with the first components of its estimate only."""
    if isinstance(observer, ConstantInput):
        assert isinstance(observer.inner, LinearObserver)  # noqa: S101 - designs are made of single observers
        return ConstantInput(replace(observer.inner, M=observer.inner.M[:count], D=observer.inner.D[:count]))
    return replace(observer, M=observer.M[:count], D=observer.D[:count])
