"""The one path from a history to an observer, whatever its order: rank, behaviour, solutions, choice, checks."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass as checked_dataclass

from monitor.acceptor import fixed_modes, regress, solve, solve_of_rank, unseen_motion
from monitor.certificate import Certificate
from monitor.data_report import report_data
from monitor.errors import HistoryError
from monitor.freedom import FreedomOptions, Problem, Refusal, Strategy, choose
from monitor.history import data_matrices
from monitor.observer import Design
from monitor.options import STRICT
from monitor.output_map import Misfit, identify_output_map
from monitor.proof import SIGMAS, Allowance, hold_back, leverage, noise, of_their_size, prove, rounding, stretches
from monitor.rank import LOST, RankBasis, RankOptions, decide_rank
from monitor.scaling import norms, spreads
from monitor.sight import measure_dynamics, measure_residual, noise_covariance
from monitor.subspace import Method, averaged, span
from monitor.trials import try_observer
from monitor.wording import accepted, blind_reason

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from monitor.acceptor import Acceptors
    from monitor.behaviour import Behaviour
    from monitor.certificate import DataReport
    from monitor.history import DataMatrices, History
    from monitor.linear_observer import LinearObserver
    from monitor.proof import Proof, Split
    from monitor.rank import RankDecision
    from monitor.scaling import Scaling

_PLACED = 5e-5  # eigenvalues this far from where they were asked for are not there
_SCHUR = 1.0 - 1e-9  # a spectral radius from here on is no decay
_BAND = 1e-6  # zeros this close to the unit circle are borderline
_CLOSE = 1e2  # times what rounding or noise explains: a decision closer than that is borderline
_ROUNDING = 1e-9  # relative: below it a direction of the regressors carries rounding only
_TILTED = 0.1  # a subspace that may be wrong by more is not known
_NOISE_SAFETY = 3.0  # directions closer than this to the error of the subspace are not told from noise
_TINY = 1e-300  # keeps 0 / 0 out of a relative misfit


@checked_dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class DesignOptions:
    """Options of every unknown-input observer.

    Attributes:
        unknown_inputs: m_d, when it is known.
        noise_std: standard deviation of the noise on the recorded x, one number or one a state, when it is known.
        relative_tolerance: what counts as rounding in exact data, in shares of the spread; None: 1e-10, and the rank
            is called ambiguous where something lies between that and double precision.
        method: how the behaviour is found in noisy data (docs/noise.md); on exact data all agree.
        repeated: the experiments repeat one another (same start, same inputs): average them.
        strategy: how the free matrix Q is chosen.
        decay: largest modulus of the eigenvalues of A_UIO, for the strategies that move them.
        poles: eigenvalues of A_UIO, for pole_placement.
        noise_budget: noise gain allowed, for max_sensitivity; None: that of minimum_norm.
        threshold: the residual threshold that the certificate's smallest bias refers to, one number or one an output.
        allow_blind: accept an observer whose residual can show nothing, for its estimate.
    """

    unknown_inputs: int | None = Field(default=None, ge=0)
    noise_std: tuple[float, ...] | float | None = None
    relative_tolerance: float | None = Field(default=None, gt=0.0, lt=1.0)
    method: Method = Method.STRUCTURED
    repeated: bool = False
    strategy: Strategy = Strategy.MINIMUM_NORM
    decay: float | None = Field(default=None, gt=0.0, lt=1.0)
    poles: tuple[float, ...] | None = None
    noise_budget: float | None = Field(default=None, gt=0.0)
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
    draft = Certificate(kind=shape.kind, accepted=False, verdict="")
    try:
        history = averaged(history) if options.repeated else history
        _check_lengths(history, options)
        split = hold_back(history)
        units = _units_of(split.seen)
        data = data_matrices(units.spread.scaled(split.seen))
        into = units.spread.relative_to(units.norm)
        comparable = data.in_units(into.u, into.y, into.x)
        output = identify_output_map(comparable)
        rest, sizes = output.rest(comparable), output.rest_sizes(comparable)
        decision = decide_rank(comparable, _rank_options(options, units), rest, sizes)
        draft = replace(draft, data=report_data(history, data, decision, output))
        if decision.unknown_inputs is None:
            return _refuse(draft, decision.reason)
        exact = decision.basis is RankBasis.EXACT  # all methods agree, the least costly one will do
        method = Method.REGRESSION if exact else options.method
        tolerance = _subspace_error(decision, output.error(data.columns))
        weights = _weights(options, units)
        behaviour = span(comparable, decision.unknown_inputs, method, weights, output=output, tolerance=tolerance)
    except HistoryError as error:
        return _refuse(draft, str(error))
    selection = shape.selection(behaviour)
    solved = _solved(behaviour, selection, units, tolerance)
    if isinstance(solved, str):
        return _refuse(draft, solved)
    acceptors, notes = solved
    problem = Problem(acceptors=acceptors, build=lambda W: shape.observer(behaviour, acceptors, W))
    freedom = FreedomOptions(decay=options.decay, poles=options.poles, noise_budget=options.noise_budget)
    W = choose(problem, options.strategy, freedom)
    if isinstance(W, Refusal):
        return _refuse(draft, W.reason)
    solution = _Solution(
        behaviour=behaviour,
        acceptors=acceptors,
        observer=problem.build(W),
        W=W,
        misfit=_kernel_residual(comparable, selection, W),
        state=selection @ units.norm.x,
        units=units,
        split=split,
        exact=exact and Misfit.NOISE not in output.kinds,
        rounding=decision.rounding,
        hardly=max(decision.tilt, SIGMAS / decision.clearness),
        notes=notes,
    )
    return _checked(draft, options, solution)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Units:
    """Two ways to scale the signals: decisions are made in shares of their spread, norms are taken in the other."""

    spread: Scaling
    norm: Scaling


@dataclass(frozen=True, slots=True, kw_only=True)
class _Solution:
    """What came out of the choice, in the units in which norms are taken; state (k,) is their size for z."""

    behaviour: Behaviour
    acceptors: Acceptors
    observer: LinearObserver
    W: NDArray[np.float64]
    misfit: float
    state: NDArray[np.float64]
    units: _Units
    split: Split
    exact: bool
    rounding: float
    hardly: float
    notes: str


def _units_of(history: History) -> _Units:
    spread = spreads(history)
    return _Units(spread=spread, norm=norms(history, spread))


def _solved(
    behaviour: Behaviour, selection: NDArray[np.float64], units: _Units, tolerance: float
) -> tuple[Acceptors, str] | str:
    """All solutions and what is borderline about them, or why there is no stable one: in shares of the spread."""
    back = units.norm.relative_to(units.spread)
    regression = regress(behaviour.in_units(back.u, back.y, back.x), selection)
    decided = solve(regression, tolerance)
    if decided is None:
        moved, trace = unseen_motion(regression, tolerance)
        close = "; borderline" if min(moved, trace * _CLOSE) > tolerance or moved < _CLOSE * tolerance else ""
        return (
            "no unknown-input observer exists: ker S is not in ker X_f, T (13) fails (rank CE < rank E): a step that "
            f"leaves {trace:.1g} in inputs and outputs moves the state by {moved:.1g} of its spread (rounding or noise "
            f"is {tolerance:.1g}){close}; measure more outputs"
        )
    modes, band = np.abs(fixed := fixed_modes(decided)), max(_BAND, tolerance)
    on_circle = f"; borderline: zeros within {band:.1g} of the unit circle"
    if np.any(modes >= _SCHUR):
        listed = ", ".join(f"{mode:.4g}" for mode in fixed[modes >= _SCHUR])
        close = on_circle if np.any(np.abs(modes[modes >= _SCHUR] - 1.0) <= band) else ""
        return (
            f"no stable unknown-input observer exists: (A, E, C) has the unstable zeros {listed}{close}; "
            "measure more outputs"
        )
    notes = on_circle if np.any(modes >= 1.0 - band) else ""
    if decided.margin < _CLOSE * tolerance:
        notes += f"; borderline: rank CE rests on a singular value of {decided.margin:.1g}, {tolerance:.1g} is rounding"
    return solve_of_rank(regress(behaviour, selection), decided.rank, tolerance), notes


def _checked(draft: Certificate, options: DesignOptions, solution: _Solution) -> Design:
    """Measure the observer; refuse what is not stable, sees nothing or does not hold on unseen samples."""
    observer, units, data = solution.observer, solution.units, draft.data
    assert data is not None  # noqa: S101 - there is no solution without data
    A_UIO = solution.W[:, solution.acceptors.regression.state_columns]
    dynamics = measure_dynamics(A_UIO, options.strategy.value, solution.misfit, data.sampling_period_sec)
    state = np.concatenate([solution.state, np.ones(observer.order - len(solution.state))])
    final = units.norm.observer(observer, state)
    C = units.norm.y[:, None] * solution.behaviour.C / units.norm.x
    draft = replace(draft, dynamics=dynamics, matrices={"C": C, **final.matrices()})
    if dynamics.spectral_radius >= _SCHUR:
        name = options.strategy.value
        stable = "dual_lqr can stabilise it"
        if options.strategy is Strategy.DUAL_LQR:
            stable = "a mode is hardly seen, borderline; ask for a decay nearer 1, or measure more outputs"
        return _refuse(draft, f"{name} is not stable, spectral radius {dynamics.spectral_radius:.4g}: {stable}")
    if _is_slower(dynamics.spectral_radius, options):
        return _refuse(
            draft,
            f"{options.strategy.value}: the eigenvalues cannot be placed accurately, borderline: the spectral radius "
            f"is {dynamics.spectral_radius:.6g}, a decay of {options.decay:g} was asked for; ask for one nearer 1",
        )
    threshold = np.array(np.broadcast_to(np.asarray(options.threshold, dtype=np.float64), (observer.outputs,)))
    residual = measure_residual(observer, threshold, units.norm.y)
    proof = _proved(solution, options, data)
    draft = replace(draft, residual=residual, proof=proof)
    if not proof.holds:
        return _refuse(draft, proof.refusal())
    if solution.exact and proof.hardly > _TILTED:
        return _refuse(
            draft,
            f"borderline: rounding of the samples may leave {proof.hardly:.1g} of the spread in the estimate, it is "
            "amplified that much; ask for another decay or strategy, measure more outputs, or excite more",
        )
    if residual.blind and not options.allow_blind:
        return _refuse(draft, blind_reason(data))
    certificate = replace(draft, accepted=True, verdict=accepted(data, dynamics, residual, proof) + solution.notes)
    return Design(kind=draft.kind, observer=final, certificate=certificate)


def _is_slower(radius: float, options: DesignOptions) -> bool:
    """Whether rounding keeps the eigenvalues from the decay that was asked of a strategy that promises it."""
    promised = options.strategy in {Strategy.DUAL_LQR, Strategy.POLE_PLACEMENT} and options.poles is None
    return promised and options.decay is not None and radius > options.decay + _PLACED


def _proved(solution: _Solution, options: DesignOptions, data: DataReport) -> Proof:
    """Run the observer over the samples that were held back, in shares of the spread."""
    units, split = solution.units, solution.split
    into = units.norm.relative_to(units.spread)
    observer = into.observer(solution.observer, np.ones(solution.observer.order))
    unseen = try_observer(observer, units.spread.scaled(split.unseen), split.overlap)
    n, p, rank = observer.states, observer.outputs, data.rank or 0
    answers = float(np.sqrt(np.max(np.diag(noise_covariance(observer, np.eye(p))), initial=0.0)))
    longest = max((len(one.error) for one in unseen), default=0)
    gain = answers + float(np.linalg.norm(solution.W)) + _transient(observer, longest)
    seen, new = (_trajectories(units.spread.scaled(one)) for one in (split.seen, split.unseen))
    tolerance = max(solution.rounding, options.relative_tolerance or 0.0)
    allowed = rounding(tolerance, gain, unseen, leverage(seen, new, rank))
    if not solution.exact:
        fitted = try_observer(observer, units.spread.scaled(split.seen), split.overlap)
        stated = None
        if options.noise_std is not None:
            std = units.spread.noise(options.noise_std)
            C = into.y[:, None] * solution.behaviour.C / into.x  # the noise on x as y shows it
            levels = np.diag(noise_covariance(observer, C @ np.diag(std**2) @ C.T))
            stated = Allowance(error=np.sqrt(levels[:n]) + std, residual=np.sqrt(levels[n:]), basis="that stated")
        allowed = noise(fitted, rank, allowed, stated)
    scales = (units.spread.x, units.spread.y)
    hardly, relative = solution.hardly, of_their_size(unseen)
    if solution.exact:
        unseen, hardly = relative, max(hardly, LOST * tolerance) * (1.0 + gain)
    else:  # signals that have died out say little about a fresh start
        hardly = max(hardly, *(float(np.max(np.abs(one.error), initial=0.0)) for one in relative), 0.0)
    return prove(unseen, allowed, scales, spare_columns=data.columns - rank, hardly=hardly)


def _transient(observer: LinearObserver, steps: int) -> float:
    """How far rounding of the state may grow within a run before it dies out: largest |[M; H] A^t|."""
    rows, largest = np.vstack([observer.M, observer.H]), 0.0
    for _ in range(steps):
        rows = rows @ observer.A
        largest = max(largest, float(np.linalg.norm(rows)))
    return largest


def _trajectories(history: History) -> NDArray[np.float64]:
    """[u_t; x_t; u_t+1; x_t+1] of all pairs of consecutive samples without a gap; y follows from them."""
    pairs = [np.hstack([one.u[:-1], one.x[:-1], one.u[1:], one.x[1:]]) for one in stretches(history)]
    width = 2 * (history.inputs + history.states)
    return np.vstack([np.zeros((0, width)), *pairs]).T


def _refuse(draft: Certificate, reason: str) -> Design:
    return Design(kind=draft.kind, observer=None, certificate=replace(draft, verdict=f"refused: {reason}"))


def _check_lengths(history: History, options: DesignOptions) -> None:
    """Raise HistoryError when an option has another number of entries than the history has signals."""
    for name, count in (("noise_std", history.states), ("threshold", history.outputs)):
        value = getattr(options, name)
        if isinstance(value, tuple) and len(value) != count:
            raise HistoryError(f"{name} has {len(value)} entries, expected 1 or {count}")


def _rank_options(options: DesignOptions, units: _Units) -> RankOptions:
    noise_std = None if options.noise_std is None else tuple(units.norm.noise(options.noise_std).tolist())
    return RankOptions(
        unknown_inputs=options.unknown_inputs, noise_std=noise_std, relative_tolerance=options.relative_tolerance
    )


def _weights(options: DesignOptions, units: _Units) -> NDArray[np.float64]:
    """1 / noise_std of each state, up to a factor; equal when nothing is known."""
    if options.noise_std is None:
        return np.ones_like(units.norm.x)
    std = units.norm.noise(options.noise_std)
    return np.asarray(np.min(std) / std)


def _subspace_error(decision: RankDecision, output_error: float) -> float:
    """How far the behaviour may be tilted: rounding or noise, against the weakest unknown input and excitation.

    Raises:
        HistoryError: rounding alone may tilt it anywhere.
    """
    m_d, values = decision.unknown_inputs or 0, decision.innovation_values
    weakest, rounding = decision.weakest, decision.tilt
    if rounding > _TILTED:
        raise HistoryError(
            f"borderline: the weakest unknown input moves the states by {weakest:.1g} of their spread, the weakest "
            f"excitation is {decision.excitation[-1]:.1g}, and rounding ({decision.rounding:.1g}) hides where they "
            "point; excite more"
        )
    exact = decision.basis is RankBasis.EXACT or m_d >= len(values)
    noise = 0.0 if exact else float(values[m_d] / (weakest if m_d else values[0] + 1.0))
    return max(_ROUNDING, rounding, min(_NOISE_SAFETY * max(noise, output_error), _TILTED))


def _kernel_residual(data: DataMatrices, selection: NDArray[np.float64], W: NDArray[np.float64]) -> float:
    """|X_f - W S| / |X_f| on the data as recorded, without any truncation."""
    S = np.vstack([data.U_p, data.Y_p, selection @ data.X_p, data.U_f, data.Y_f])
    target = selection @ data.X_f
    return float(np.linalg.norm(target - W @ S) / max(float(np.linalg.norm(target)), _TINY))
