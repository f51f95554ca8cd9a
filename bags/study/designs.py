"""The observer of every link in a study: from a history, or, for comparison, from the true matrices."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass as checked_dataclass

from bags.study.settings import StudyObserver
from bags.watch.designs import LinkMethod, RunDesigns, design_run
from bags.watch.histories import histories_of_run
from bags.wire.convert import history_of
from bags.wire.schema import parts_of, topics_of
from dgu_sim.matrices import continuous, discretise
from dgu_sim.plant import Coupling
from dgu_sim.scenario import Scenario
from monitor.baselines import Model, decoupling_gains, identify_then_design, model_based_uio
from monitor.errors import MonitorError
from monitor.history import History, sent_outputs
from monitor.link_design import LinkDesign
from monitor.observers import Observer
from monitor.options import STRICT, parse_options, within
from monitor.settings import DetectorSettings

_UNKNOWN_INPUTS = 2  # d of T (17)


@checked_dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class BaselineOptions:
    """Options of the baselines.

    Attributes:
        decay: every mode of the observer is at most this.
    """

    decay: float = Field(default=0.5, gt=0.0, lt=1.0)


def method_of(kind: str, options: Mapping[str, object], scenario: Scenario) -> LinkMethod | None:
    """What designs the observers of a baseline in a run of the scenario; None: the kind is no baseline.

    Raises:
        monitor.errors.MonitorError: Unknown option.
    """
    if kind not in BASELINES:
        return None
    parsed = parse_options(BaselineOptions, options, kind)

    def design(dgu: int, history: History) -> LinkDesign:
        sent, channels = sent_outputs(history)
        try:
            observer = BASELINES[kind](scenario, dgu, sent, channels, parsed)
        except (MonitorError, np.linalg.LinAlgError) as error:
            return LinkDesign(kind=kind, observer=None, channels=channels, verdict=f"refused: {error}")
        return LinkDesign(kind=kind, observer=observer, channels=channels, verdict="accepted: baseline")

    return design


def designs_of(observer: StudyObserver, scenario: Scenario, monitors: Sequence[int] | None = None) -> RunDesigns:
    """Return what is designed for the runs of a scenario's seed, which has histories of its own.

    Args:
        observer: How.
        scenario: With what seed, on what grid.
        monitors: The DGUs whose monitors are wanted; None: all.

    Raises:
        monitor.errors.OptionError: An option does not fit; its key is one of the study's observer.
    """
    settings = observer.settings(DetectorSettings())
    topics = replace(topics_of(scenario), has_team=False, parts=parts_of(settings))
    histories = {dgu: history_of(histories_of_run(scenario, dgu)) for dgu in topics.dgus}
    with within("observer"):
        method = method_of(observer.kind, observer.options, scenario)
    return design_run(topics, settings, histories, method=method, monitors=monitors)


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
