"""The observer of every link in a study: from a history, or, for comparison, from the true matrices."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import final

import numpy as np
from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass as checked_dataclass

from bags.watch.histories import histories_of_run
from bags.wire.convert import history_of
from dgu_sim.matrices import continuous, discretise
from dgu_sim.plant import Coupling
from dgu_sim.scenario import Scenario
from monitor import observers
from monitor.baselines import Model, decoupling_gains, identify_then_design, model_based_uio
from monitor.errors import HistoryError, MonitorError
from monitor.history import History, sent_outputs
from monitor.observers import Observer
from monitor.options import parse_options

_UNKNOWN_INPUTS = 2  # d of T (17)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class StudyDesign:
    """What watches the links from one DGU.

    Attributes:
        observer: None when refused.
        channels: Positions in the received vector of the outputs that it uses; None: the first ones.
        blind: Its residual shows nothing.
        verdict: One line in plain words.
    """

    observer: Observer | None
    channels: tuple[int, ...] | None
    blind: bool
    verdict: str


@checked_dataclass(frozen=True, slots=True, kw_only=True, config=ConfigDict(extra="forbid"))
class BaselineOptions:
    """Options of the baselines.

    Attributes:
        decay: every mode of the observer is at most this.
    """

    decay: float = Field(default=0.5, gt=0.0, lt=1.0)


def design_for(kind: str, options: Mapping[str, object], scenario: Scenario, dgu: int) -> StudyDesign:
    """Design what watches the links from one DGU in a run of the scenario with its seed.

    Raises:
        monitor.errors.MonitorError: Unknown kind or option.
    """
    history = history_of(histories_of_run(scenario, dgu))
    if kind in BASELINES:
        sent, channels = sent_outputs(history)
        parsed = parse_options(BaselineOptions, options, kind)
        try:
            observer = BASELINES[kind](scenario, dgu, sent, channels, parsed)
        except (MonitorError, np.linalg.LinAlgError) as error:
            return StudyDesign(observer=None, channels=channels, blind=False, verdict=f"refused: {error}")
        return StudyDesign(observer=observer, channels=channels, blind=False, verdict="accepted: baseline")
    try:
        found = observers.design(kind, history, options)
    except HistoryError as error:
        return StudyDesign(observer=None, channels=None, blind=False, verdict=f"refused: {error}")
    return StudyDesign(observer=found.observer, channels=found.channels, blind=found.blind, verdict=found.verdict)


def _model_based(
    scenario: Scenario, dgu: int, history: History, channels: tuple[int, ...], options: BaselineOptions
) -> Observer:
    """Build the UIO of the true matrices: those of the DGU on its lines, whose neighbours are unknown inputs."""
    del history
    conductances = {} if scenario.coupling is Coupling.ISOLATED else scenario.grid.conductances(dgu)
    matrices = continuous(scenario.grid.parameters[dgu], sum(conductances.values()))
    A, E = discretise(*matrices, scenario.sampling_period_sec)
    model = Model(A=A, B=np.empty((len(A), 0)), E=E, C=np.eye(len(A))[list(channels)])
    return model_based_uio(model, decoupling_gains(model, options.decay))


def _identified(
    scenario: Scenario, dgu: int, history: History, channels: tuple[int, ...], options: BaselineOptions
) -> Observer:
    """Build the UIO of a model fitted to the history."""
    del scenario, dgu, channels
    return identify_then_design(history, _UNKNOWN_INPUTS, options.decay)


BASELINES: Mapping[str, Callable[[Scenario, int, History, tuple[int, ...], BaselineOptions], Observer]] = {
    "model_based": _model_based,
    "identify_then_design": _identified,
}
"""Observers that know more than data, or use it in the classical way."""
