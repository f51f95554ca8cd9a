"""From a record of the whole grid to the members of a team, or to the condition that fails."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from monitor import detectors
from monitor.backstop import guarded
from monitor.carrying import RUNNING, parsed
from monitor.distributed import DistributedReport, design, sampled
from monitor.distributed.gains import error_dynamics, lie_response, stability
from monitor.history import Experiment
from monitor.team.member import Member, node_of
from monitor.team.plan import INPUTS, WIDTH, TeamPlan

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from monitor.distributed import DistributedDesign, NodeGains, NodeObserver, Regressors
    from monitor.history import History

KIND = "distributed"


@dataclass(frozen=True, slots=True, kw_only=True)
class TeamPhase:
    """The proof for the time in which the same members are there.

    Attributes:
        from_step: first step of it.
        present: their numbers.
        connected: assumption 1 of D holds among them.
        radius: spectral radius of their errors.
    """

    from_step: int
    present: tuple[int, ...]
    connected: bool
    radius: float


@dataclass(frozen=True, slots=True, kw_only=True)
class TeamReport:
    """What a team knows about itself.

    Attributes:
        members: DGU numbers.
        structure: "leader" or "mutual".
        network: what the design found.
        phases: the proof for every change of who is there.
        harm: for each member and a lie of 1 V, 1 A, 1 V s: the largest steady error of another member's V [V], I_t [A],
            v [V s], as long as nobody leaves the liar out; (members, 3, 3).
        isolated: for each member, spectral radius of all errors while its neighbours leave it out.
    """

    members: tuple[int, ...]
    structure: str
    network: DistributedReport
    phases: tuple[TeamPhase, ...] = ()
    harm: tuple[tuple[tuple[float, ...], ...], ...] = ()
    isolated: tuple[float, ...] = ()

    def to_json(self) -> str:
        """One JSON document."""
        return json.dumps(asdict(self))


@dataclass(frozen=True, slots=True, kw_only=True)
class Team:
    """The members of a team as they run, designed now or carried from elsewhere.

    Attributes:
        accepted: whether there is a converging team.
        verdict: one line in plain words.
        members: in the order of the plan; those of a refused team say REFUSED at every step.
        documents: the report and what each member runs, as JSON.
    """

    accepted: bool
    verdict: str
    members: tuple[Member, ...]
    documents: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class TeamDesign:
    """The members of a team, or why there is none; a refused team's members say REFUSED at every step.

    Attributes:
        accepted: whether there is a converging team.
        verdict: one line in plain words.
        report: what was found.
        members: in the order of the plan.
    """

    accepted: bool
    verdict: str
    report: TeamReport
    members: tuple[Member, ...]

    @property
    def team(self) -> Team:
        """What runs."""
        report = asdict(self.report)
        documents = tuple([json.dumps({**report, RUNNING: member.document()}) for member in self.members])
        return Team(accepted=self.accepted, verdict=self.verdict, members=self.members, documents=documents)


def carried_team(plan: TeamPlan, verdict: str, documents: Sequence[str]) -> Team | None:
    """Take a team from its documents; None where they do not hold everything.

    Args:
        plan: who is in the team.
        verdict: what the design said.
        documents: of each member, in the order of the plan.
    """
    members = []
    for member, document in zip(plan.members, documents, strict=True):
        running = parsed(document).get(RUNNING)
        if not isinstance(running, dict):
            return None
        members.append(_member(plan, member, tuple(running["channels"]), node_of(running)))
    accepted = all(one.observer is not None for one in members)
    return Team(accepted=accepted, verdict=verdict, members=tuple(members), documents=tuple(documents))


def design_team(plan: TeamPlan, history: History) -> TeamDesign:
    """Design all members; every member can do so for itself and comes to the same result.

    Args:
        plan: who is in the team.
        history: of the whole grid: u (T, 2 N) inputs, y (T, 3 N) outputs, NaN where a component is never sent, x (T,
            3 N), DGUs ascending.

    Raises:
        MonitorError: a history of another grid, or options that do not fit.
    """
    data, channels = [], []
    for member in plan.members:
        measured = plan.measured(member)
        sent = [at for at, column in enumerate(measured) if _is_sent(history, column)]
        channels.append(tuple(sent))
        data.append(_regressors(history, plan.known_inputs(member), [measured[at] for at in sent]))
    unknown = tuple(INPUTS * len(plan.members) - len(plan.known_inputs(member)) for member in plan.members)
    options: dict[str, object] = {"structure": plan.structure, "unknown_inputs": unknown}
    if plan.leader is not None:
        options["leader"] = plan.members.index(plan.leader)
    if plan.chi is not None:
        options["chi"] = plan.chi
    made = design(data, plan.network, options)
    report = TeamReport(members=plan.members, structure=plan.structure, network=made.report)
    if not made.accepted:
        return _team(plan, _named(made.verdict, plan), report, channels, ())
    return guarded(
        lambda: _measured(plan, made, channels),
        lambda reason: _team(plan, f"refused: {reason}", report, channels, ()),
    )


def _measured(plan: TeamPlan, made: DistributedDesign, channels: Sequence[tuple[int, ...]]) -> TeamDesign:
    """An accepted network as a team, with what every phase and every lie does to it."""
    phases = tuple(_phase(plan, made, step) for step in plan.changes())
    report = TeamReport(
        members=plan.members,
        structure=plan.structure,
        network=made.report,
        phases=phases,
        harm=_harm(plan, made.gains),
        isolated=tuple(_isolated(plan, made.gains, at) for at in range(len(plan.members))),
    )
    for phase in phases:
        if phase.radius >= 1.0:
            listed = ", ".join(map(str, phase.present))
            reason = f"refused: from step {phase.from_step} on, with members {listed} alone, the spectral radius of"
            return _team(plan, f"{reason} their errors is {phase.radius:.5g}, expected below 1", report, channels, ())
    return _team(plan, made.verdict, report, channels, made.observers)


def _team(
    plan: TeamPlan,
    verdict: str,
    report: TeamReport,
    channels: Sequence[tuple[int, ...]],
    observers: Sequence[NodeObserver],
) -> TeamDesign:
    members = tuple(
        _member(plan, member, channels[at], observers[at] if observers else None)
        for at, member in enumerate(plan.members)
    )
    return TeamDesign(accepted=bool(observers), verdict=verdict, report=report, members=members)


def _member(plan: TeamPlan, member: int, channels: tuple[int, ...], observer: NodeObserver | None) -> Member:
    return Member(
        observer=observer,
        team=len(plan.members),
        channels=channels,
        detector=detectors.build("fixed", plan.detector, plan.sampling_period_sec),
        isolate=plan.isolate,
        presence=tuple(one for one in plan.presence if one.member == member),
        lies=tuple(one for one in plan.lies if one.member == member),
    )


def _is_sent(history: History, column: int) -> bool:
    """Whether an output ever arrives: one that is never sent is NaN throughout."""
    return any(bool(np.isfinite(one.y[:, column]).any()) for one in history.experiments)


def _regressors(history: History, inputs: Sequence[int], outputs: Sequence[int]) -> Regressors:
    """What one member has of the record."""
    experiments = tuple(
        Experiment(one.u[:, list(inputs)], one.y[:, list(outputs)], one.x) for one in history.experiments
    )
    return sampled(replace(history, experiments=experiments))


def _phase(plan: TeamPlan, made: DistributedDesign, step: int) -> TeamPhase:
    there = [at for at, member in enumerate(plan.members) if plan.there(member, step)]
    away = [at for at in range(len(plan.members)) if at not in there]
    network = plan.network.without(away)
    n = WIDTH * len(plan.members)
    kept = [at * n + row for at in there for row in range(n)]
    matrix = error_dynamics(made.gains, network)[np.ix_(kept, kept)]
    adjacency = network.adjacency[np.ix_(there, there)]
    return TeamPhase(
        from_step=step,
        present=tuple(plan.members[at] for at in there),
        connected=not there or not type(network)(adjacency=adjacency).unreachable(),
        radius=stability(matrix, sampled=True) if there else 0.0,
    )


def _isolated(plan: TeamPlan, gains: Sequence[NodeGains], outcast: int) -> float:
    """Spectral radius while nobody listens to one member: it still listens to the others."""
    matrix = error_dynamics(gains, plan.network)
    n = len(gains[0].E)
    for at in plan.network.neighbours(outcast):
        pull = gains[at].chi * plan.network.adjacency[at, outcast] * np.eye(n)
        matrix[at * n : (at + 1) * n, at * n : (at + 1) * n] += pull
        matrix[at * n : (at + 1) * n, outcast * n : (outcast + 1) * n] -= pull
    return stability(matrix, sampled=True)


def _harm(plan: TeamPlan, gains: Sequence[NodeGains]) -> tuple[tuple[tuple[float, ...], ...], ...]:
    """Largest steady errors that a lie of one unit causes others."""
    found = []
    for liar in range(len(plan.members)):
        others = [at for at in range(len(plan.members)) if at != liar]
        rows = []
        for kind in range(WIDTH):
            bias = np.tile(np.eye(WIDTH)[kind], len(plan.members))
            errors = np.abs(lie_response(gains, plan.network, liar, bias, sampled=True))[others]
            rows.append(tuple(float(np.max(_kind(errors, state))) for state in range(WIDTH)))
        found.append(tuple(rows))
    return tuple(found)


def _kind(errors: NDArray[np.float64], state: int) -> NDArray[np.float64]:
    return errors[:, state::WIDTH]


def _named(verdict: str, plan: TeamPlan) -> str:
    """The verdict with DGU numbers: the design counts nodes from 1 in the order of the members."""
    return verdict if plan.members == tuple(range(1, len(plan.members) + 1)) else f"{verdict} (nodes {plan.members})"
