"""The delayed observer from history alone (ours: C knows the matrices; the derivation is in docs/which_observer.md).

Conditions: y = C x in the history; [X_p; U_p; 1] of full row rank; the number m_d of unknown inputs is decided. Exact
gains are the same in all coordinates of the unknown input: they come from the behaviour that fits a noisy history
best. Where there are none, Theta, Gamma and Phi of the representative model give the gains, and C's bound holds for the
unknown input in the coordinates of `coordinates`: |w'| = 1 is the largest unknown input that the history showed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass as checked_dataclass

from monitor.backstop import guarded
from monitor.behaviour import identify_output
from monitor.data_report import report_data
from monitor.delayed.coordinates import represent, represent_behaviour, with_attacks
from monitor.delayed.designing import DelayedOptions, Goal, Units, design_for, refuse
from monitor.delayed.proving import Claim, prove_delayed
from monitor.delayed.units import in_units
from monitor.errors import HistoryError, MonitorError
from monitor.history import data_matrices
from monitor.options import STRICT, parse_options
from monitor.proof import SIGMAS, hold_back
from monitor.rank import RankBasis, RankOptions, decide_rank
from monitor.scaling import norms, spreads
from monitor.subspace import Method, span

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from monitor.certificate import DataReport
    from monitor.delayed.model import Model
    from monitor.delayed.report import DelayedDesign
    from monitor.history import DataMatrices, History
    from monitor.rank import RankDecision
    from monitor.scaling import Scaling

KIND = "delayed"
_ROUNDING = 1e-9  # relative: below it a direction carries rounding only
_TOLERANCE = 1e-10  # relative rounding of exact samples
_NOISE_SAFETY = 3.0  # directions closer than this to the error of the model are not told from noise
_COARSE = 0.1
_TINY = 1e-300  # keeps 0 / 0 out


@checked_dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class HistoryOptions(DelayedOptions):
    """Options of the data-driven delayed observer, besides those of every delayed observer.

    Attributes:
        unknown_inputs: m_d, when it is known.
        noise_std: standard deviation of the noise on the recorded x, when it is known.
        relative_tolerance: what counts as rounding in exact data; None: 1e-10, and the rank is called ambiguous where
            something lies between that and double precision.
        method: how the behaviour is found in noisy data, for exact gains (docs/noise.md).
        attacked: positions in y of outputs that may be falsified; the attack then is part of the unknown input.
        attack_bound: size [units of y] of an attack that counts as |w| = 1.
    """

    unknown_inputs: int | None = Field(default=None, ge=0)
    noise_std: tuple[float, ...] | float | None = None
    relative_tolerance: float | None = Field(default=None, gt=0.0, lt=1.0)
    method: Method = Method.STRUCTURED
    attacked: tuple[int, ...] = ()
    attack_bound: float = Field(default=1.0, gt=0.0)


def design(history: History, options: Mapping[str, object]) -> DelayedDesign:
    """Design the delayed observer from a history; a refusal is a value.

    Raises:
        MonitorError: an option that does not fit.
    """
    return design_chosen(history, parse_options(HistoryOptions, options, KIND))


def design_chosen(history: History, chosen: HistoryOptions) -> DelayedDesign:
    """Design with options that are checked already."""
    try:
        return guarded(lambda: _design(history, chosen), lambda reason: refuse(KIND, reason))
    except HistoryError as error:
        return refuse(KIND, str(error))


def _design(history: History, chosen: HistoryOptions) -> DelayedDesign:
    found = _look(history, chosen)
    if found.decision.unknown_inputs is None:
        return refuse(KIND, found.decision.reason, found.report)
    if not all(0 <= channel < len(found.C) for channel in chosen.attacked):
        reason = f"attacked is {chosen.attacked}, expected positions 0 to {len(found.C) - 1}"
        return refuse(KIND, reason, found.report)
    if chosen.goal is not Goal.BOUNDED:
        exact = _proved(_exact(found, chosen), found)
        if exact.accepted or chosen.goal is Goal.EXACT:
            return replace(exact, certificate=replace(exact.certificate, data=found.report))
    return _proved(_bounded(found, chosen), found)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Found:
    """What the seen part of a history shows, in the units in which norms are taken."""

    data: DataMatrices
    C: NDArray[np.float64]
    decision: RankDecision
    report: DataReport
    norm: Scaling
    weights: NDArray[np.float64]
    claim: Claim
    sampling_period_sec: float

    @property
    def units(self) -> Units:
        """For the design from the model."""
        Y, X = (np.hstack(pair) for pair in ((self.data.Y_p, self.data.Y_f), (self.data.X_p, self.data.X_f)))
        moved = np.linalg.norm(Y - np.mean(Y, axis=1, keepdims=True), axis=1)
        on_outputs = float(np.max(np.linalg.norm(Y - self.C @ X, axis=1) / np.maximum(moved, _TINY), initial=0.0))
        tolerance = min(max(_model_error(self.decision), _NOISE_SAFETY * on_outputs), _COARSE)
        return Units(x=self.norm.x, y=self.norm.y, tolerance=tolerance)


def _look(history: History, chosen: HistoryOptions) -> _Found:
    """Scale, hold back, and decide on the number of unknown inputs.

    Raises:
        HistoryError: the history does not allow a design.
    """
    n, std = history.states, chosen.noise_std
    if isinstance(std, tuple) and len(std) != n:
        raise HistoryError(f"noise_std has {len(std)} entries, expected 1 or {n}")
    split = hold_back(history, max(chosen.delay, 1))
    spread = spreads(split.seen)
    norm = norms(split.seen, spread)
    data = data_matrices(spread.scaled(split.seen))
    options = RankOptions(
        unknown_inputs=chosen.unknown_inputs,
        noise_std=None if std is None else tuple(spread.noise(std).tolist()),
        relative_tolerance=chosen.relative_tolerance,
    )
    decision = decide_rank(data, options)
    report = report_data(history, data, decision)
    into = spread.relative_to(norm)
    data = data.in_units(into.u, into.y, into.x)
    noise = np.ones(n) if std is None else norm.noise(std)
    return _Found(
        data=data,
        C=identify_output(data),
        decision=decision,
        report=report,
        norm=norm,
        weights=np.asarray(np.min(noise) / noise),
        claim=Claim(
            split=split,
            spread=spread,
            exact=decision.basis is RankBasis.EXACT,
            unknowns=report.rank or 0,
            spare_columns=data.columns - (report.rank or 0),
            tolerance=chosen.relative_tolerance or _TOLERANCE,
            hardly=max(decision.tilt, SIGMAS / decision.clearness),
        ),
        sampling_period_sec=history.sampling_period_sec,
    )


def _model_error(decision: RankDecision) -> float:
    """How far directions may be tilted: rounding, or noise against the weakest unknown input."""
    m_d, values = decision.unknown_inputs or 0, decision.innovation_values
    if decision.basis is RankBasis.EXACT or m_d >= len(values):
        return max(_ROUNDING, decision.tilt)
    return max(_ROUNDING, decision.tilt, _NOISE_SAFETY * float(values[m_d]) / decision.weakest)


def _exact(found: _Found, chosen: HistoryOptions) -> DelayedDesign:
    """Cancel the unknown inputs altogether, on the trajectories that are left of a noisy history."""
    exact_data = found.claim.exact  # all methods agree, the least costly one will do
    method = Method.TOTAL_LEAST_SQUARES if exact_data else chosen.method
    try:
        behaviour = span(found.data, found.decision.unknown_inputs or 0, method, found.weights)
        plant = represent_behaviour(found.data, behaviour)
        model = with_attacks(plant, chosen.attacked, chosen.attack_bound / found.norm.y)
    except (HistoryError, MonitorError) as error:
        return refuse(KIND, str(error), found.report)
    made = design_for(
        KIND,
        model,
        replace(chosen, goal=Goal.EXACT),
        found.sampling_period_sec,
        unit="the largest unknown input of the history",
        data=found.report,
        units=found.units,
    )
    return _with_fit(made, found.data, plant, found.data.U_p)


def _bounded(found: _Found, chosen: HistoryOptions) -> DelayedDesign:
    """Bound what the unknown inputs do, as deviations from the operating point of the history."""
    data = found.data
    try:
        plant = represent(data, found.C, found.decision.unknown_inputs or 0).model
        model = with_attacks(plant, chosen.attacked, chosen.attack_bound / found.norm.y)
    except MonitorError as error:
        return refuse(KIND, str(error), found.report)
    made = design_for(
        KIND,
        model,
        replace(chosen, goal=Goal.BOUNDED),
        found.sampling_period_sec,
        unit="the largest unknown input of the history, from its mean",
        data=found.report,
        constant=True,
        units=found.units,
    )
    return _with_fit(made, data, plant, np.vstack([np.ones((1, data.columns)), data.U_p]))


def _proved(made: DelayedDesign, found: _Found) -> DelayedDesign:
    """Back into the user's units, and over the samples that were held back."""
    if made.observer is None:
        return made
    final = in_units(made, found.norm)
    proof = prove_delayed(final, found.claim)
    if not proof.holds:
        refused = refuse(KIND, proof.refusal(), found.report)
        return replace(refused, certificate=replace(refused.certificate, proof=proof))
    certificate = replace(final.certificate, proof=proof, verdict=f"{final.verdict}; {proof.words()}")
    return replace(final, certificate=certificate)


def _with_fit(made: DelayedDesign, data: DataMatrices, model: Model, known: NDArray[np.float64]) -> DelayedDesign:
    """Record how well the history obeys x_k+1 = A x_k + B_u known + B w_k for some w_k."""
    if made.certificate.dynamics is None:
        return made
    rest = data.X_f - model.A @ data.X_p - model.B_u @ known
    misfit = rest - model.B @ (np.linalg.pinv(model.B) @ rest)
    share = float(np.linalg.norm(misfit) / np.linalg.norm(data.X_f))
    dynamics = replace(made.certificate.dynamics, kernel_residual=share)
    return replace(made, certificate=replace(made.certificate, dynamics=dynamics))
