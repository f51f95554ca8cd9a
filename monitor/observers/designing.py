"""The one path from a history to an observer, whatever its order: rank, behaviour, solutions, choice, checks."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass as checked_dataclass

from monitor.acceptor import regress, solve, unstable_fixed_modes
from monitor.behaviour import span
from monitor.certificate import Certificate, DataReport
from monitor.errors import HistoryError
from monitor.freedom import Strategy, choose
from monitor.history import data_matrices
from monitor.observers.protocol import Design
from monitor.rank import RankOptions, decide_rank
from monitor.sight import measure_dynamics, measure_residual

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from monitor.acceptor import Acceptors
    from monitor.behaviour import Behaviour
    from monitor.history import DataMatrices, History
    from monitor.observers.linear_observer import LinearObserver
    from monitor.rank import RankDecision

_SCHUR = 1.0 - 1e-9  # a spectral radius from here on is no decay


@checked_dataclass(frozen=True, slots=True, kw_only=True, config=ConfigDict(extra="forbid"))
class DesignOptions:
    """Options of every unknown-input observer.

    Attributes:
        strategy: how the free matrix Q is chosen.
        unknown_inputs: m_d, when it is known.
        noise_std: standard deviation of the noise on the recorded x, one number or one a state, when it is known.
        relative_tolerance: what counts as rounding in exact data.
        threshold: the residual threshold that the certificate's smallest bias refers to, one number or one an output.
        allow_blind: accept an observer whose residual can show nothing, for its estimate.
    """

    strategy: Strategy = Strategy.MINIMUM_NORM
    unknown_inputs: int | None = Field(default=None, ge=0)
    noise_std: tuple[float, ...] | float | None = None
    relative_tolerance: float = Field(default=1e-10, gt=0.0, lt=1.0)
    threshold: tuple[float, ...] | float = 1e-3
    allow_blind: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Shape:
    """What distinguishes one observer order from another.

    Attributes:
        kind: name of the design method.
        selection: (k, n) rows that pick the states the observer integrates.
        observer: puts a solution W into running form.
    """

    kind: str
    selection: Callable[[Behaviour], NDArray[np.float64]]
    observer: Callable[[Behaviour, Acceptors, NDArray[np.float64]], LinearObserver]


def design_uio(history: History, options: DesignOptions, shape: Shape) -> Design:
    """Design an unknown-input observer, or refuse in one line."""
    refused = Certificate(kind=shape.kind, accepted=False, verdict="")
    try:
        data = data_matrices(history)
        decision = decide_rank(
            data,
            RankOptions(
                unknown_inputs=options.unknown_inputs,
                noise_std=options.noise_std,
                relative_tolerance=options.relative_tolerance,
            ),
        )
        refused = replace(refused, data=_report(history, data, decision))
        if decision.unknown_inputs is None:
            return _refuse(refused, decision.reason)
        return _design(data, span(data, decision.unknown_inputs), options, shape, refused)
    except HistoryError as error:
        return _refuse(refused, str(error))


def _design(
    data: DataMatrices, behaviour: Behaviour, options: DesignOptions, shape: Shape, refused: Certificate
) -> Design:
    """Solve, choose Q, check: everything after the rank is decided."""
    selection = shape.selection(behaviour)
    acceptors = solve(regress(behaviour, selection), _ACCEPTOR_TOLERANCE)
    if acceptors is None:
        return _refuse(refused, "no unknown-input observer exists: ker S is not in ker X_f, T (13) (rank CE < rank E)")
    fixed = unstable_fixed_modes(acceptors, _SCHUR)
    if len(fixed):
        listed = ", ".join(f"{mode:.4g}" for mode in fixed)
        return _refuse(refused, f"no stable unknown-input observer exists: (A, E, C) has the unstable zeros {listed}")
    W = choose(acceptors, options.strategy)
    observer = shape.observer(behaviour, acceptors, W)
    target, S = _recorded(data, behaviour, selection)
    kernel_residual = float(np.linalg.norm(target - W @ S) / max(float(np.linalg.norm(target)), _TINY))
    assert refused.data is not None  # noqa: S101 - set by the caller
    period = refused.data.sampling_period_sec
    dynamics = measure_dynamics(observer, options.strategy.value, kernel_residual, period)
    refused = replace(refused, dynamics=dynamics, matrices=_matrices(observer, behaviour))
    if dynamics.spectral_radius >= _SCHUR:
        return _refuse(
            refused,
            f"{options.strategy.value} is not stable: spectral radius {dynamics.spectral_radius:.4g}; "
            "another strategy can stabilise it",
        )
    residual = measure_residual(observer, _threshold(options, observer.outputs))
    refused = replace(refused, residual=residual)
    if residual.blind and not options.allow_blind:
        return _refuse(refused, _blind_reason(behaviour, observer.outputs))
    verdict = _verdict(refused)
    return Design(kind=shape.kind, observer=observer, certificate=replace(refused, accepted=True, verdict=verdict))


_ACCEPTOR_TOLERANCE = 1e-9  # relative: below it a direction of the regressors carries rounding only
_TINY = 1e-300  # keeps 0 / 0 out of a relative misfit


def _refuse(certificate: Certificate, reason: str) -> Design:
    verdict = f"refused: {reason}"
    return Design(kind=certificate.kind, observer=None, certificate=replace(certificate, verdict=verdict))


def _report(history: History, data: DataMatrices, decision: RankDecision) -> DataReport:
    n, m = history.states, history.inputs
    S = np.vstack([data.U_p, data.Y_p, data.X_p, data.U_f, data.Y_f])
    m_d = decision.unknown_inputs
    return DataReport(
        states=n,
        known_inputs=m,
        outputs=history.outputs,
        experiments=data.experiments,
        columns=data.columns,
        dropped=data.dropped,
        sampling_period_sec=history.sampling_period_sec,
        unknown_inputs=m_d,
        rank=None if m_d is None else 2 * m + n + m_d,
        rank_basis=decision.basis.value,
        rank_confidence=decision.confidence,
        rank_reason=decision.reason,
        exciting=m_d is not None,
        excitation=decision.excitation,
        innovation_values=decision.innovation_values,
        singular_values=np.asarray(np.linalg.svd(S, compute_uv=False), dtype=np.float64),
    )


def _recorded(
    data: DataMatrices, behaviour: Behaviour, selection: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Target and regressors of T (13) as recorded, without any truncation."""
    del behaviour
    S = np.vstack([data.U_p, data.Y_p, selection @ data.X_p, data.U_f, data.Y_f])
    return selection @ data.X_f, S


def _matrices(observer: LinearObserver, behaviour: Behaviour) -> dict[str, NDArray[np.float64]]:
    names = ("A", "B", "M", "D", "H", "J", "Z")
    return {"C": behaviour.C, **{name: getattr(observer, name) for name in names}}


def _threshold(options: DesignOptions, outputs: int) -> NDArray[np.float64]:
    return np.array(np.broadcast_to(np.asarray(options.threshold, dtype=np.float64), (outputs,)))


def _blind_reason(behaviour: Behaviour, outputs: int) -> str:
    m_d = behaviour.unknown_inputs
    if m_d >= outputs:
        return f"blind: {m_d} unknown inputs explain every change of {outputs} outputs, the residual is always zero"
    return "blind: the residual stays zero under every falsification; choose another strategy"


def _verdict(certificate: Certificate) -> str:
    data, dynamics, residual = certificate.data, certificate.dynamics, certificate.residual
    assert data is not None  # noqa: S101 - all three parts stand before a verdict
    assert dynamics is not None  # noqa: S101
    assert residual is not None  # noqa: S101
    speed = f"errors shrink to 1 % in {dynamics.convergence_steps} steps (radius {dynamics.spectral_radius:.3g})"
    if residual.blind:
        return f"accepted for its estimate only, BLIND to every falsification; {speed}"
    hidden = residual.invisible_bias.shape[1]
    return (
        f"accepted: {data.unknown_inputs} unknown inputs ({data.rank_basis}); {speed}; the residual has rank "
        f"{residual.residual_rank} of {data.outputs}: {hidden} directions of constant bias leave no steady residual"
    )
