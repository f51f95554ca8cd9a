"""The delayed observer from history alone (ours: C knows the matrices; the derivation is in docs/which_observer.md).

Conditions: y = C x in the history; [X_p; U_p; 1] of full row rank; the number m_d of unknown inputs is decided. Exact
gains are the same in all coordinates of the unknown input: they come from the behaviour that fits a noisy history
best. Where there are none, Theta, Gamma and Phi of the representative model give the gains, and C's bound holds for the
unknown input in the coordinates of `coordinates`: |w'| = 1 is the largest unknown input that the history showed.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass as checked_dataclass

from monitor.behaviour import identify_output
from monitor.data_report import report_data
from monitor.delayed.coordinates import represent, represent_behaviour, with_attacks
from monitor.delayed.designing import DelayedOptions, Goal, design_for, refuse
from monitor.errors import HistoryError
from monitor.history import data_matrices
from monitor.options import parse_options
from monitor.rank import RankBasis, RankOptions, decide_rank
from monitor.subspace import Method, span

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from monitor.delayed.model import Model
    from monitor.delayed.report import DelayedDesign
    from monitor.history import DataMatrices, History
    from monitor.rank import RankDecision

KIND = "delayed"


@checked_dataclass(frozen=True, slots=True, kw_only=True, config=ConfigDict(extra="forbid"))
class HistoryOptions(DelayedOptions):
    """Options of the data-driven delayed observer, besides those of every delayed observer.

    Attributes:
        unknown_inputs: m_d, when it is known.
        noise_std: standard deviation of the noise on the recorded x, when it is known.
        relative_tolerance: what counts as rounding in exact data.
        method: how the behaviour is found in noisy data, for exact gains (docs/noise.md).
        attacked: positions in y of outputs that may be falsified; the attack then is part of the unknown input.
        attack_bound: size [units of y] of an attack that counts as |w| = 1.
    """

    unknown_inputs: int | None = Field(default=None, ge=0)
    noise_std: tuple[float, ...] | float | None = None
    relative_tolerance: float = Field(default=1e-10, gt=0.0, lt=1.0)
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
        data = data_matrices(history)
        C = identify_output(data)
        decision = decide_rank(
            data,
            RankOptions(
                unknown_inputs=chosen.unknown_inputs,
                noise_std=chosen.noise_std,
                relative_tolerance=chosen.relative_tolerance,
            ),
        )
    except HistoryError as error:
        return refuse(KIND, str(error))
    report = report_data(history, data, decision)
    if decision.unknown_inputs is None:
        return refuse(KIND, decision.reason, report)
    if not all(0 <= channel < len(C) for channel in chosen.attacked):
        return refuse(KIND, f"attacked is {chosen.attacked}, expected positions 0 to {len(C) - 1}", report)
    if chosen.goal is not Goal.BOUNDED:
        exact = _exact(history, chosen, data, decision)
        if exact.accepted or chosen.goal is Goal.EXACT:
            return replace(exact, certificate=replace(exact.certificate, data=report))
    found = represent(data, C, decision.unknown_inputs)
    model = with_attacks(found.model, chosen.attacked, chosen.attack_bound)
    unit = "the largest unknown input of the history, from its mean"
    bounded = replace(chosen, goal=Goal.BOUNDED)
    made = design_for(KIND, model, bounded, history.sampling_period_sec, unit=unit, data=report, constant=True)
    return _with_fit(made, data, found.model, np.vstack([np.ones((1, data.columns)), data.U_p]))


def _exact(history: History, chosen: HistoryOptions, data: DataMatrices, decision: RankDecision) -> DelayedDesign:
    """Cancel the unknown inputs altogether, on the trajectories that are left of a noisy history."""
    n = history.states
    noise_std = np.broadcast_to(np.asarray(1.0 if chosen.noise_std is None else chosen.noise_std), (n,))
    exact_data = decision.basis is RankBasis.EXACT  # all methods agree, the least costly one will do
    method = Method.TOTAL_LEAST_SQUARES if exact_data else chosen.method
    try:
        behaviour = span(data, decision.unknown_inputs or 0, method, np.asarray(noise_std.min() / noise_std))
    except HistoryError as error:
        return refuse(KIND, str(error))
    plant = represent_behaviour(data, behaviour)
    model = with_attacks(plant, chosen.attacked, chosen.attack_bound)
    unit = "the largest unknown input of the history"
    goal = replace(chosen, goal=Goal.EXACT)
    return _with_fit(design_for(KIND, model, goal, history.sampling_period_sec, unit=unit), data, plant, data.U_p)


def _with_fit(made: DelayedDesign, data: DataMatrices, model: Model, known: NDArray[np.float64]) -> DelayedDesign:
    """Record how well the history obeys x_k+1 = A x_k + B_u known + B w_k for some w_k."""
    if made.certificate.dynamics is None:
        return made
    rest = data.X_f - model.A @ data.X_p - model.B_u @ known
    misfit = rest - model.B @ (np.linalg.pinv(model.B) @ rest)
    share = float(np.linalg.norm(misfit) / np.linalg.norm(data.X_f))
    dynamics = replace(made.certificate.dynamics, kernel_residual=share)
    return replace(made, certificate=replace(made.certificate, dynamics=dynamics))
