"""What all monitors of a run are designed to run: from histories, or as a bag carries it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias, final

from bags.watch.carried import Carried
from bags.watch.team import RunTeam, carried_run_team, design_run_team
from bags.wire.convert import design_record
from bags.wire.documents import DesignCodec
from bags.wire.records import DesignRecord
from bags.wire.schema import RunTopics
from dgu_sim.grid import Link
from dgu_sim.settings import MonitorSettings
from monitor import input_estimators, local
from monitor.combined import CombinedDesign, CombinedPlan, LocalPlan, design_own
from monitor.history import History
from monitor.input_estimators import EstimatorDesign
from monitor.link_design import LinkDesign, carried_link, design_link
from monitor.local import LocalDesign
from monitor.team import TeamPlan

LinkMethod: TypeAlias = Callable[[int, History], LinkDesign]
"""From the number of a DGU and its history to what watches the links from it."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class RunDesigns:
    """Everything that the monitors of a run, or some of them, run.

    Attributes:
        topics: DGUs, links and T_s.
        plan: What every monitor is told besides data.
        dgus: What is designed for each monitor.
        team: The team of monitors, if there is one.
    """

    topics: RunTopics
    plan: CombinedPlan
    dgus: Mapping[int, CombinedDesign]
    team: RunTeam | None = None

    @property
    def links(self) -> tuple[LinkDesign, ...]:
        """What watches each link, in the order of the links."""
        return tuple(one for design in self.dgus.values() for one in design.links)

    def judged_by(self, kind: str, options: Mapping[str, object]) -> "RunDesigns":
        """The same observers under another detector."""
        return replace(self, plan=replace(self.plan, detector=(kind, options)))

    def messages(self) -> tuple[tuple[DesignCodec, DesignRecord], ...]:
        """What the monitors say about their designs before step 0, in canonical order."""
        found, own, estimators = [], [], []
        combined = self.topics.combined
        for monitor, design in self.dgus.items():
            incoming = _incoming(self.topics, monitor)
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
        team = [] if self.team is None else self.team.messages()
        return (*found, *own, *estimators, *team)


def plan_of(settings: MonitorSettings, sampling_period_sec: float) -> CombinedPlan:
    """What a scenario tells the monitor of every DGU."""
    own, plausible = settings.local, settings.plausibility
    return CombinedPlan(
        observer=(settings.observer.kind, settings.observer.options),
        detector=(settings.detector.kind, settings.detector.options),
        sampling_period_sec=sampling_period_sec,
        local=None
        if own is None
        else LocalPlan(
            decay=own.decay,
            load_sec=own.load_sec,
            load_range_a=own.load_range_a,
            detector=(own.detector.kind, own.detector.options),
        ),
        estimator=None if plausible is None else (plausible.estimator.kind, plausible.estimator.options),
        limits={} if plausible is None else plausible.limits.model_dump(),
        quiet_sec=None if settings.response is None else settings.response.quiet_sec,
    )


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
        monitor.errors.MonitorError: Unknown kind or option, or one that does not fit.
    """
    plan = plan_of(settings, topics.sampling_period_ns * 1e-9)
    designer = _Designer(topics=topics, plan=plan, settings=settings, histories=histories, carried=carried)
    designer = designer if method is None else replace(designer, method=method)
    return RunDesigns(
        topics=topics,
        plan=plan,
        dgus={dgu: designer.dgu(dgu) for dgu in (topics.monitors if monitors is None else monitors)},
        team=None if team is None or topics.team is None else designer.team(*team),
    )


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Designer:
    """Designs what is not carried; links from one DGU share a design."""

    topics: RunTopics
    plan: CombinedPlan
    settings: MonitorSettings
    histories: Mapping[int, History]
    carried: Carried | None
    method: LinkMethod
    links: dict[int, LinkDesign]
    inputs: dict[int, EstimatorDesign]

    def dgu(self, monitor: int) -> CombinedDesign:
        incoming = _incoming(self.topics, monitor)
        links = tuple(self._link(link) for link in incoming)
        inputs = tuple(self._input(link) for link in incoming) if self.plan.estimator is not None else ()
        own = None if self.plan.local is None else self._local(monitor, self.plan.local, links)
        return CombinedDesign(links=links, inputs=inputs, local=own)

    def _link(self, link: Link) -> LinkDesign:
        source, history = link.source, self.histories[link.source]
        if self.carried is not None and self.carried.settings.observer == self.settings.observer:
            record = self.carried.record(self.topics.design(link))
            found = None if record is None else carried_link(record.observer, record.certificate, history)
            if found is not None:
                return found
        if source not in self.links:
            self.links[source] = self.method(source, history)
        return self.links[source]
