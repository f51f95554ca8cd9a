"""A design made in scaled units, in the user's."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from monitor.constant_input import ConstantInput, linear_part
from monitor.delayed.model import Model, window_of
from monitor.input_reconstruction.uncertainty import noise_gain

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.certificate import Guarantee
    from monitor.delayed.report import DelayedDesign
    from monitor.linear_observer import LinearObserver
    from monitor.scaling import Scaling


def in_units(made: DelayedDesign, scaling: Scaling) -> DelayedDesign:
    """Turn an accepted design in scaled units into the user's; unknown inputs keep theirs.

    A constant 1 among the known inputs keeps its size. The residual report is in the user's units already, see
    `design_for`.

    Args:
        made: accepted.
        scaling: of the signals that it was made from.
    """
    assert made.observer is not None  # noqa: S101 - see above
    assert made.input_observer is not None  # noqa: S101 - see above
    assert made.model is not None  # noqa: S101 - see above
    assert made.L is not None  # noqa: S101 - see above
    delay = 0 if made.guarantee is None else made.guarantee.delay
    constant = isinstance(made.observer, ConstantInput)
    known = np.concatenate([[1.0], scaling.u]) if constant else scaling.u
    scaling = replace(scaling, u=known)
    model = scaled_model(made.model, x=scaling.x, y=scaling.y, u=known)
    L = scaling.x[:, None] * made.L / np.tile(scaling.y, delay + 1)
    window = window_of(model, delay)
    inputs = _running(made.input_observer, replace(scaling, x=np.ones(model.B.shape[1])), scaling.x, delay)
    matrices = {"Q": model.A - L @ window.Theta, "L": L, "Theta": window.Theta, "Gamma": window.Gamma}
    guarantee = None if made.guarantee is None else _bounds(made.guarantee, scaling.x, scaling.y)
    return replace(
        made,
        observer=_running(made.observer, scaling, scaling.x, delay),
        input_observer=inputs,
        certificate=replace(made.certificate, matrices=matrices, guarantee=guarantee),
        model=model,
        L=L,
        input_noise_gain=noise_gain(linear_part(inputs)),
    )


def scaled_model(model: Model, *, x: NDArray[np.float64], y: NDArray[np.float64], u: NDArray[np.float64]) -> Model:
    """The model of signals so many times larger; unknown inputs stay as they are."""
    return Model(
        A=x[:, None] * model.A / x,
        B=x[:, None] * model.B,
        C=y[:, None] * model.C / x,
        D=y[:, None] * model.D,
        B_u=x[:, None] * model.B_u / u,
        D_u=y[:, None] * model.D_u / u,
    )


def _running(
    observer: LinearObserver | ConstantInput, scaling: Scaling, x: NDArray[np.float64], delay: int
) -> LinearObserver | ConstantInput:
    """The running form: its state is xhat and `delay` samples of what is received."""
    state = np.concatenate([x, np.tile(scaling.v, delay)])
    if isinstance(observer, ConstantInput):
        return ConstantInput(scaling.observer(linear_part(observer), state))
    return scaling.observer(observer, state)


def _bounds(guarantee: Guarantee, x: NDArray[np.float64], y: NDArray[np.float64]) -> Guarantee:
    """Bounds on the residual are in units of y; those on H e have the units of H e whatever those of x."""
    moved, certain = guarantee.residual_bound, guarantee.certain_bias
    return replace(
        guarantee,
        weights=None if guarantee.weights is None else guarantee.weights / x,
        residual_bound=None if moved is None else y * moved,
        certain_bias=None if certain is None else y * certain,
    )
