"""From a model in some coordinates of the unknown input to the observer: shared by both ways to come to the model."""

from __future__ import annotations

from dataclasses import replace
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np
from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass as checked_dataclass

from monitor.acceptor import unobservable
from monitor.certificate import Certificate, Guarantee, smallest_crossing
from monitor.delayed.bounds import ErrorResponse, certify, respond, respond_input
from monitor.delayed.decoupling import Decoupling, decouple
from monitor.delayed.innovation import moved_by_inputs, residual_rows
from monitor.delayed.model import window_of
from monitor.delayed.performance import optimise
from monitor.delayed.realisation import ConstantInput, realise, realise_input
from monitor.delayed.report import DelayedDesign
from monitor.input_reconstruction.uncertainty import noise_gain
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


@checked_dataclass(frozen=True, slots=True, kw_only=True, config=ConfigDict(extra="forbid"))
class DelayedOptions:
    """Options of every delayed observer.

    Attributes:
        delay: delta in steps.
        goal: `exact` decouples or refuses, `bounded` minimises C's bound, `best` decouples where it can.
        weights: diagonal of the performance matrix H, one number a state; all 1 unless given.
        threshold: the residual threshold that the certificate's smallest bias refers to.
    """

    delay: int = Field(default=1, ge=0)
    goal: Goal = Goal.BEST
    weights: tuple[float, ...] | None = None
    threshold: float = Field(default=1e-3, gt=0.0)


def design_for(
    kind: str,
    model: Model,
    options: DelayedOptions,
    sampling_period_sec: float,
    *,
    unit: str,
    data: DataReport | None = None,
    constant: bool = False,
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
    """
    window = window_of(model, options.delay)
    H = np.eye(len(model.A)) if options.weights is None else np.diag(options.weights)
    if H.shape != model.A.shape:
        return refuse(kind, f"{len(H)} weights for {len(model.A)} states, expected one each", data)
    decoupling = decouple(model, window)
    L, reason = _gain(model, window, H, options.goal, decoupling)
    if L is None:
        return refuse(kind, reason, data)
    exact = decoupling.L is L
    dynamics = measure_dynamics(model.A - L @ window.Theta, "dual_lqr" if exact else "lmi", 0.0, sampling_period_sec)
    if dynamics.spectral_radius >= _SCHUR:
        return refuse(kind, f"no stable gain is found: spectral radius {dynamics.spectral_radius:.4g}", data)
    R = residual_rows(window, len(model.C), decoupling.N if exact else None)
    observer = realise(model, window, L, R)
    residual = measure_residual(observer, np.full(len(model.C), options.threshold))
    guarantee = _guarantee(model, window, L, H, exact=exact)
    moved = np.zeros(len(model.C)) if exact else moved_by_inputs(model, window, L, R)
    guarantee = replace(
        guarantee,
        decay=dynamics.spectral_radius,
        gained_rank=decoupling.gained_rank,
        needed_rank=decoupling.needed_rank,
        residual_bound=moved,
        certain_bias=smallest_crossing(residual.peak_gain, 2.0 * moved),
        unit=unit,
    )
    certificate = Certificate(
        kind=kind,
        accepted=True,
        verdict=f"{_verdict(guarantee, dynamics.convergence_steps)}; {_sees(guarantee, residual)}",
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


def _sees(guarantee: Guarantee, residual: ResidualReport) -> str:
    """What the residual shows; when unknown inputs move it too, only what they cannot hide counts."""
    moved, certain = guarantee.residual_bound, guarantee.certain_bias
    if guarantee.exact or residual.blind or moved is None or certain is None:
        return sees(residual)
    biases = ", ".join(f"{bias:.3g}" for bias in certain)
    return (
        f"unknown inputs alone move the residual up to {np.max(moved):.3g}, biases below {biases} may hide behind them"
    )


def _verdict(guarantee: Guarantee, steps: int | None) -> str:
    speed = f"first errors shrink to 1 % in {steps} steps"
    late = f"state {guarantee.lag} and inputs {guarantee.delay} steps late"
    if guarantee.exact:
        return f"accepted: unknown inputs cancelled exactly, {late}; {speed}"
    return (
        f"accepted: no exact decoupling, |H e| <= {min(guarantee.bound, guarantee.response_bound):.3g} sup |w| "
        f"(inputs that reach {guarantee.reached:.3g} are known), |w| = 1 being {guarantee.unit}; {late}; {speed}"
    )
