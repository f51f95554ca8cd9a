"""The delayed observer from history alone (ours: C knows the matrices; the derivation is in docs/which_observer.md).

Conditions: y = C x in the history; [X_p; U_p; 1] of full row rank; the number m_d of unknown inputs is decided. Then
Theta, Gamma and Phi of the representative model give the gains, and C's bound holds for the unknown input measured in
the coordinates of `coordinates`: |w'| = 1 is the largest unknown input that the history showed.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass as checked_dataclass

from monitor.behaviour import identify_output
from monitor.data_report import report_data
from monitor.delayed.coordinates import represent, with_attacks
from monitor.delayed.designing import DelayedOptions, design_for, refuse
from monitor.errors import HistoryError
from monitor.history import data_matrices
from monitor.options import parse_options
from monitor.rank import RankOptions, decide_rank

if TYPE_CHECKING:
    from collections.abc import Mapping

    from monitor.delayed.coordinates import Representative
    from monitor.delayed.report import DelayedDesign
    from monitor.history import DataMatrices, History

KIND = "delayed"


@checked_dataclass(frozen=True, slots=True, kw_only=True, config=ConfigDict(extra="forbid"))
class HistoryOptions(DelayedOptions):
    """Options of the data-driven delayed observer, besides those of every delayed observer.

    Attributes:
        unknown_inputs: m_d, when it is known.
        noise_std: standard deviation of the noise on the recorded x, when it is known.
        relative_tolerance: what counts as rounding in exact data.
        attacked: positions in y of outputs that may be falsified; the attack then is part of the unknown input.
        attack_bound: size [units of y] of an attack that counts as |w| = 1.
    """

    unknown_inputs: int | None = Field(default=None, ge=0)
    noise_std: tuple[float, ...] | float | None = None
    relative_tolerance: float = Field(default=1e-10, gt=0.0, lt=1.0)
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
    found = represent(data, C, decision.unknown_inputs)
    model = with_attacks(found.model, chosen.attacked, chosen.attack_bound)
    unit = "the largest unknown input of the history, from its mean"
    made = design_for(KIND, model, chosen, history.sampling_period_sec, unit=unit, data=report, constant=True)
    return _with_fit(made, data, found)


def _with_fit(made: DelayedDesign, data: DataMatrices, found: Representative) -> DelayedDesign:
    """Record how well the history obeys x_k+1 = A x_k + b + B_u u_k + B w'_k."""
    if made.certificate.dynamics is None:
        return made
    model = found.model
    known = np.vstack([np.ones((1, data.columns)), data.U_p])
    misfit = data.X_f - model.A @ data.X_p - model.B_u @ known - model.B @ found.W
    share = float(np.linalg.norm(misfit) / np.linalg.norm(data.X_f))
    dynamics = replace(made.certificate.dynamics, kernel_residual=share)
    return replace(made, certificate=replace(made.certificate, dynamics=dynamics))
