"""From a model in some coordinates of the unknown input to the observer: shared by both ways to come to the model."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass as checked_dataclass

from monitor.acceptor import unobservable
from monitor.certificate import Certificate, Guarantee, smallest_crossing
from monitor.constant_input import ConstantInput
from monitor.delayed.bounds import ErrorResponse, certify, respond, respond_input
from monitor.delayed.decoupling import Decoupling, decouple
from monitor.delayed.innovation import moved_by_inputs, residual_rows
from monitor.delayed.model import window_of
from monitor.delayed.performance import optimise
from monitor.delayed.realisation import realise, realise_input
from monitor.delayed.report import DelayedDesign
from monitor.input_reconstruction.uncertainty import noise_gain
from monitor.options import STRICT
from monitor.sight import measure_dynamics, measure_residual
from monitor.wording import sees

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.certificate import DataReport, ResidualReport
    from monitor.delayed.model import Model, Window

_STARTS = 20  # directions from which the worst input is searched
_SCHUR = 1.0 - 1e-9


class Goal(Enum):
    """What the gain is to do."""

    BEST = "best"
    EXACT = "exact"
    BOUNDED = "bounded"


@checked_dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class DelayedOptions:
    """Options of every delayed observer.

    Attributes:
        delay: delta in steps.
        goal: `exact` decouples or refuses, `bounded` minimises C's bound, `best` decouples where it can.
        weights: diagonal of the performance matrix H, one number a state in units of 1 / x; unless given all 1 where
            units are comparable (a model, V and A of a DGU), else 1 / spread of each state.
        threshold: the residual threshold that the certificate's smallest bias refers to.
    """

    delay: int = Field(default=1, ge=0)
    goal: Goal = Goal.BEST
    weights: tuple[float, ...] | None = None
    threshold: float = Field(default=1e-3, gt=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Units:
    """Units of a model that comes from data, and how sure it is.

    Attributes:
        x: (n,) scale of the states in the user's units.
        y: (p,) of the outputs.
        tolerance: how far the model may be off, relative.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    tolerance: float = 1e-9


def design_for(
    kind: str,
    model: Model,
    options: DelayedOptions,
    sampling_period_sec: float,
    *,
    unit: str,
    data: DataReport | None = None,
    constant: bool = False,
    units: Units | None = None,
) -> DelayedDesign:
    """Choose the gain, put it into running form and measure what it guarantees.

    Args:
        kind: name of the method.
        model: the plant.
        options: what is asked for.
        sampling_period_sec: T_s [s].
        unit: what |w_k| = 1 means in this model.
        data: what the history showed, when the model comes from one.
        constant: the first known input of the model is the constant 1.
        units: those of the model, when they are not the user's; the residual report is in the user's.
    """
    n, p = len(model.A), len(model.C)
    units = units or Units(x=np.ones(n), y=np.ones(p))
    window = window_of(model, options.delay)
    if options.weights is not None and len(options.weights) != n:
        return refuse(kind, f"{len(options.weights)} weights for {n} states, expected one each", data)
    H = np.eye(n) if options.weights is None else np.diag(np.array(options.weights) * units.x)
    decoupling = decouple(model, window, units.tolerance)
    L, reason = _gain(model, window, H, options.goal, decoupling)
    if L is None:
        return refuse(kind, reason, data)
    exact = decoupling.L is L
    dynamics = measure_dynamics(model.A - L @ window.Theta, "dual_lqr" if exact else "lmi", 0.0, sampling_period_sec)
    if dynamics.spectral_radius >= _SCHUR:
        return refuse(kind, f"no stable gain is found: spectral radius {dynamics.spectral_radius:.4g}", data)
    R = residual_rows(window, p, decoupling.N if exact else None)
    observer = realise(model, window, L, R)
    residual = measure_residual(observer, np.full(p, options.threshold), units.y)
    guarantee = _guarantee(model, window, L, H, exact=exact)
    moved = np.zeros(p) if exact else moved_by_inputs(model, window, L, R)
    guarantee = replace(
        guarantee,
        decay=dynamics.spectral_radius,
        gained_rank=decoupling.gained_rank,
        needed_rank=decoupling.needed_rank,
        residual_bound=moved,
        certain_bias=smallest_crossing(residual.peak_gain * units.y / units.y[:, None], 2.0 * moved),
        unit=unit,
        weights=np.diag(H).copy(),
    )
    doubt = f"; borderline: {decoupling.doubt}" if exact and decoupling.doubt else ""
    certificate = Certificate(
        kind=kind,
        accepted=True,
        verdict=f"{_verdict(guarantee, dynamics.convergence_steps)}; {_sees(guarantee, residual, units.y)}{doubt}",
        data=data,
        dynamics=dynamics,
        residual=residual,
        lag=observer.lag,
        guarantee=guarantee,
        matrices={"Q": model.A - L @ window.Theta, "L": L, "Theta": window.Theta, "Gamma": window.Gamma},
    )
    inputs = realise_input(model, window, observer)
    return DelayedDesign(
        kind=kind,
        observer=ConstantInput(observer) if constant else observer,
        input_observer=ConstantInput(inputs) if constant else inputs,
        certificate=certificate,
        model=model,
        L=L,
        input_noise_gain=noise_gain(inputs),
    )


def refuse(kind: str, reason: str, data: DataReport | None = None) -> DelayedDesign:
    """A design that did not come about, with the reason in one line."""
    certificate = Certificate(kind=kind, accepted=False, verdict=f"refused: {reason}", data=data)
    return DelayedDesign(kind=kind, observer=None, input_observer=None, certificate=certificate)


def _gain(
    model: Model, window: Window, H: NDArray[np.float64], goal: Goal, decoupling: Decoupling
) -> tuple[NDArray[np.float64] | None, str]:
    """The gain that the goal asks for, or why there is none."""
    if goal is Goal.EXACT or (goal is Goal.BEST and decoupling.L is not None):
        return decoupling.L, f"no exact decoupling with delay {window.delay}, {decoupling.reason}"
    hidden = unobservable(model.A, model.C)
    modes = np.linalg.eigvals(hidden.T @ model.A @ hidden) if hidden.size else np.zeros(0)
    if np.max(np.abs(modes), initial=0.0) >= _SCHUR:
        return None, f"(A, C) is not detectable: a mode of modulus {np.max(np.abs(modes)):.4g} shows in no output"
    found = optimise(model, window, H)
    if found is None:
        return None, "C's LMI has no point for any a that double precision finds: a mode is all but undetectable"
    return found.L, ""


def _guarantee(
    model: Model, window: Window, L: NDArray[np.float64], H: NDArray[np.float64], *, exact: bool
) -> Guarantee:
    """Bounds of the gain; ranks and unit are the caller's."""
    delay = window.delay
    none = Guarantee(delay=delay, lag=max(delay - 1, 0), exact=exact)
    if exact:
        return none
    mu, a = certify(model, window, L, H)
    errors = respond(model, window, L, H)
    return replace(
        none,
        a=a,
        gamma=float(np.sqrt(mu)),
        bound=float(np.sqrt(mu * (delay + 1))),
        response_bound=errors.guaranteed,
        reached=_reach(errors),
        input_bound=respond_input(model, window, L).guaranteed,
    )


def _reach(errors: ErrorResponse) -> float:
    """Largest error that the searched inputs reach; the search always starts from the same directions."""
    directions = np.random.default_rng(0).standard_normal((_STARTS, errors.G.shape[1]))
    return max(errors.worst(direction)[0] for direction in directions)


def _sees(guarantee: Guarantee, residual: ResidualReport, y: NDArray[np.float64]) -> str:
    """What the residual shows; when unknown inputs move it too, only what they cannot hide counts."""
    moved, certain = guarantee.residual_bound, guarantee.certain_bias
    if guarantee.exact or residual.blind or moved is None or certain is None:
        return sees(residual)
    biases = ", ".join(f"{bias:.3g}" for bias in certain * y)
    alone = f"unknown inputs alone move the residual up to {np.max(moved * y):.3g}"
    return f"{alone}, biases below {biases} may hide behind them"


def _verdict(guarantee: Guarantee, steps: int | None) -> str:
    speed = f"first errors shrink to 1 % in {steps} steps"
    late = f"state {guarantee.lag} and inputs {guarantee.delay} steps late"
    if guarantee.exact:
        return f"accepted: unknown inputs cancelled exactly, {late}; {speed}"
    return (
        f"accepted: no exact decoupling, |H e| <= {min(guarantee.bound, guarantee.response_bound):.3g} sup |w| "
        f"(inputs that reach {guarantee.reached:.3g} are known), |w| = 1 being {guarantee.unit}; {late}; {speed}"
    )
