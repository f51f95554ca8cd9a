"""What all monitors of a run are designed to run: from histories, or as a bag carries it."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, TypeAlias

from bags.mcap.errors import BagError
from bags.watch.carried import Carried, Part
from bags.watch.histories import grid_history_of_run, histories_of_run
from bags.watch.team import RunTeam, plan_of, run_team
from bags.wire.convert import design_record, history_of
from bags.wire.documents import DesignCodec
from bags.wire.records import DesignRecord, HistoryRecord
from bags.wire.schema import RunTopics, topics_of
from bags.wire.settings import settings_of
from dgu_sim.errors import ScenarioError
from dgu_sim.grid import Link
from dgu_sim.scenario import Scenario
from dgu_sim.scenario_file import raised_by
from monitor import input_estimators, local
from monitor.combined import CombinedDesign, DguMonitor, design_own
from monitor.detectors import Detector
from monitor.errors import OptionError
from monitor.history import History
from monitor.input_estimators import EstimatorDesign
from monitor.link_design import LinkDesign, carried_link, design_link
from monitor.local import LocalDesign
from monitor.options import within
from monitor.settings import DetectorSettings, EstimatorSettings, LocalSettings, MonitorSettings
from monitor.team import TeamPlan

LinkMethod: TypeAlias = Callable[[int, History], LinkDesign]
"""From the number of a DGU and its history to what watches the links from it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunDesigns:
    """Everything that the monitors of a run, or some of them, run.

    Attributes:
        topics: DGUs, links and T_s.
        settings: What every monitor is told besides data.
        dgus: What is designed for each monitor.
        team: The team of monitors, if there is one.
    """

    topics: RunTopics
    settings: MonitorSettings
    dgus: Mapping[int, CombinedDesign]
    team: RunTeam | None = None

    @property
    def links(self) -> tuple[LinkDesign, ...]:
        """What watches each link, in the order of the links."""
        return tuple(one for design in self.dgus.values() for one in design.links)

    @property
    def monitors(self) -> tuple[DguMonitor, ...]:
        """What steps, in the order of the monitors; raises what `CombinedDesign.monitor` does."""
        return tuple(one.monitor(self.settings, self.sampling_period_sec) for one in self.dgus.values())

    @property
    def sampling_period_sec(self) -> float:
        """T_s [s]."""
        return self.topics.sampling_period_ns * 1e-9

    @property
    def detector(self) -> Detector[Any]:
        """The detector of every link; raises MonitorError where it does not fit T_s."""
        with within("detector"):
            return self.settings.detector.build(self.sampling_period_sec)

    def check_start(self) -> None:
        """See that everything can start: a detector may be told another number of levels than an observer has outputs.

        Raises:
            monitor.errors.OptionError: Something cannot; its key is one of the monitors' settings.
        """
        for monitor in self.monitors:
            with within("detector"):
                for link in monitor.links:
                    link.init()
            if monitor.local is not None:
                with within("local", "detector"):
                    monitor.local.init()

    def told(self) -> dict[str, DesignRecord]:
        """All that is said about designs, the team's included, by topic."""
        team = [] if self.team is None else self.team.messages()
        return {codec.topic.name: record for codec, record in (*self.messages(), *team)}

    @property
    def refusals(self) -> tuple[tuple[str, str], ...]:
        """What cannot be watched, by the topic of its design, and why."""
        return tuple((name, record.verdict) for name, record in self.told().items() if not record.accepted)

    def judged_by(self, detector: DetectorSettings) -> "RunDesigns":
        """The same observers under another detector."""
        return replace(self, settings=self.settings.model_copy(update={"detector": detector}))

    def messages(self) -> tuple[tuple[DesignCodec, DesignRecord], ...]:
        """What the monitors say about their designs before step 0, in canonical order; the team speaks for itself."""
        found, own, estimators = [], [], []
        combined = self.topics.combined
        for monitor, design in self.dgus.items():
            incoming = incoming_links(self.topics, monitor)
            found += [
                (self.topics.design(link), design_record(one, link.source, monitor))
                for link, one in zip(incoming, design.links, strict=True)
            ]
            if combined is not None and design.local is not None:
                own.append((combined.design(monitor), design_record(design.local, monitor, monitor)))
            if combined is not None and design.inputs:
                estimators += [
                    (combined.input_design(link), design_record(one, link.source, monitor))
                    for link, one in zip(incoming, design.inputs, strict=True)
                ]
        return (*found, *own, *estimators)


class Told(NamedTuple):
    """What a monitor is told besides data.

    Attributes:
        settings: What it runs.
        carried: Designs that it takes as they are where they fit; None: it designs everything.
    """

    settings: MonitorSettings
    carried: Carried | None


def design_run(
    topics: RunTopics,
    settings: MonitorSettings,
    histories: Mapping[int, History],
    *,
    carried: Carried | None = None,
    team: tuple[TeamPlan, History] | None = None,
    monitors: Sequence[int] | None = None,
    method: LinkMethod | None = None,
) -> RunDesigns:
    """Design everything that monitors run; each history once.

    Args:
        topics: The links and T_s.
        settings: What they run.
        histories: Of each DGU that is heard, and of those whose own state is watched.
        carried: Designs that are taken as they are where they were made with the same settings and are complete.
        team: The team's plan and the record of the whole grid.
        monitors: The DGUs whose monitors are designed; None: all.
        method: What designs the observers of links, None: what the settings say.

    Raises:
        BagError: A history has more known inputs than a sample carries.
        monitor.errors.MonitorError: Unknown kind or option, or one that does not fit.
    """
    for source, history in histories.items():
        if history.inputs > topics.widths.inputs:
            raise BagError(
                f"the history of DGU {source} has {history.inputs} known inputs u, expected at most "
                f"{topics.widths.inputs}, as the samples on its links carry"
            )
    make = _Maker(topics=topics, settings=settings, histories=histories, carried=carried, method=method)
    return RunDesigns(
        topics=topics,
        settings=settings,
        dgus={dgu: make.dgu(dgu) for dgu in (topics.monitors if monitors is None else monitors)},
        team=None if team is None or topics.team is None else run_team(topics.team, settings, team, carried),
    )


def design_scenario(scenario: Scenario, *, carried: Carried | None = None) -> RunDesigns:
    """Design everything that the monitors of a scenario run, from its histories.

    Raises:
        BagError: A recorded history cannot be read.
        monitor.errors.MonitorError: Unknown kind or option, or one that does not fit.
    """
    topics = topics_of(scenario)
    histories = {dgu: history_of(histories_of_run(scenario, dgu)) for dgu in topics.dgus}
    team = team_told(scenario, topics, () if topics.team is None else grid_history_of_run(scenario))
    return design_run(topics, settings_of(scenario), histories, carried=carried, team=team)


def team_told(scenario: Scenario, topics: RunTopics, grid: Sequence[HistoryRecord]) -> tuple[TeamPlan, History] | None:
    """What the members of a team are told, and the record of the whole grid; None without a team."""
    return None if topics.team is None else (plan_of(scenario, topics.team), history_of(grid))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Maker:
    """Takes what is carried and designs the rest; links from one DGU share a design."""

    topics: RunTopics
    settings: MonitorSettings
    histories: Mapping[int, History]
    carried: Carried | None
    method: LinkMethod | None
    links: dict[int, LinkDesign] = field(default_factory=dict)
    inputs: dict[int, EstimatorDesign] = field(default_factory=dict)

    def dgu(self, monitor: int) -> CombinedDesign:
        incoming = incoming_links(self.topics, monitor)
        links = tuple(self._link(link) for link in incoming)
        test, module = self.settings.plausibility, self.settings.local
        inputs = () if test is None else tuple(self._input(link, test.estimator) for link in incoming)
        own = None if module is None else self._own(monitor, module, links)
        return CombinedDesign(links=links, inputs=inputs, local=own)

    def _taken(
        self,
        codec: DesignCodec,
        asked: Callable[[MonitorSettings], object],
        restore: Callable[[DesignRecord], Part | None],
    ) -> Part | None:
        return None if self.carried is None else self.carried.take(codec, self.settings, asked, restore)

    def _link(self, link: Link) -> LinkDesign:
        history = self.histories[link.source]
        found = self._taken(
            self.topics.design(link),
            lambda settings: settings.observer,
            lambda record: carried_link(record.observer, record.certificate, history),
        )
        if found is None and link.source not in self.links:
            asked = self.settings.observer
            with within("observer"):
                fresh = (
                    self.method(link.source, history)
                    if self.method
                    else design_link(asked.kind, history, asked.options)
                )
            self.links[link.source] = fresh
        return found or self.links[link.source]

    def _input(self, link: Link, asked: EstimatorSettings) -> EstimatorDesign:
        assert self.topics.combined is not None  # noqa: S101 - a plausibility test makes it so
        found = self._taken(
            self.topics.combined.input_design(link),
            lambda settings: settings.plausibility and settings.plausibility.estimator,
            lambda record: input_estimators.carried(record.observer, record.certificate),
        )
        if found is None and link.source not in self.inputs:
            history = self.histories[link.source]
            with within("plausibility", "estimator"):
                self.inputs[link.source] = input_estimators.design(asked.kind, history, asked.options)
        return found or self.inputs[link.source]

    def _own(self, monitor: int, asked: LocalSettings, links: Sequence[LinkDesign]) -> LocalDesign:
        assert self.topics.combined is not None  # noqa: S101 - a local module makes it so
        found = self._taken(
            self.topics.combined.design(monitor),
            lambda settings: settings.local and settings.local.decay,
            lambda record: local.carried(record.certificate),
        )
        if found is not None:
            return found
        with within("local"):
            return design_own(asked, links, self.histories[monitor])


@contextmanager
def said_of(source: str, overrides: Sequence[str] = ()) -> Iterator[None]:
    """Say of a wrong setting of the monitors where it was written: one line with file, key, value, what was expected.

    Args:
        source: The file, or whatever holds the settings.
        overrides: What was changed in it, "monitor.a.b=value" each.

    Raises:
        ScenarioError: A setting does not fit.
    """
    try:
        yield
    except OptionError as error:
        key = ("monitor", *error.key)
        found = "" if error.value is None else f" = {error.value!r}"
        line = f"{raised_by(key, overrides, source)}: {'.'.join(key)}{found}: {error.expected}"
        raise ScenarioError(line) from error


def incoming_links(topics: RunTopics, monitor: int) -> tuple[Link, ...]:
    """The links into a DGU, by ascending source."""
    return tuple(link for link in topics.links if link.target == monitor)
