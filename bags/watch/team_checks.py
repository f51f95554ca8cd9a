"""What must hold between the section `monitor.team` and the rest of a scenario."""

from collections.abc import Sequence

from dgu_sim.model import finding
from dgu_sim.plant import Coupling
from dgu_sim.scenario import Scenario
from monitor.settings import TeamEventKind, TeamSettings, TeamStructure

__all__ = ["check_team", "team_links"]

_KEY = ("monitor", "team")


def team_links(scenario: Scenario, team: TeamSettings) -> tuple[tuple[int, int], ...]:
    """Return the pairs of members that exchange estimates."""
    if team.links is not None:
        return team.links
    return tuple(line.between for line in scenario.lines)


def check_team(scenario: Scenario, team: TeamSettings | None) -> None:
    """Check that a team can exist and its events make sense; raises what `dgu_sim.model.finding` returns."""
    if team is None:
        return
    members = scenario.grid.dgus
    if scenario.coupling is Coupling.ISOLATED or len(scenario.grid.components()) > 1:
        expected = "expected one connected grid: a team estimates what its members are coupled in"
        raise finding(_KEY, "on", expected)
    _check_links(team, members)
    _check_connected(members, team_links(scenario, team))
    _check_leader(team, members)
    _check_events(team, members)
    ready = team.settle_sec + team.calibrate_sec
    for index, attack in enumerate(scenario.attacks):
        if attack.start_sec < ready:
            expected = f"expected at least {ready:g}: until then the team calibrates on attack-free samples"
            raise finding(("attacks", index, "start_sec"), attack.start_sec, expected)


def _check_links(team: TeamSettings, members: Sequence[int]) -> None:
    for index, pair in enumerate(team.links or ()):
        key = (*_KEY, "links", index)
        if pair[0] == pair[1] or not set(pair) <= set(members):
            raise finding(key, list(pair), f"expected two different DGUs of {', '.join(map(str, members))}")
        if any(set(pair) == set(other) for other in (team.links or ())[:index]):
            raise finding(key, list(pair), "expected a pair that does not stand before it")


def _check_connected(members: Sequence[int], links: Sequence[tuple[int, int]]) -> None:
    reached, waiting = {members[0]}, [members[0]]
    while waiting:
        one = waiting.pop()
        new = {other for pair in links if one in pair for other in pair} - reached
        reached |= new
        waiting += sorted(new)
    lost = [member for member in members if member not in reached]
    if lost:
        found = f"no path from member {members[0]} to {', '.join(map(str, lost))}"
        shown = [list(pair) for pair in links]
        raise finding((*_KEY, "links"), shown, f"expected a connected graph (assumption 1 of D), found {found}")


def _check_leader(team: TeamSettings, members: Sequence[int]) -> None:
    if team.leader is None:
        return
    key = (*_KEY, "leader")
    if team.structure is not TeamStructure.LEADER:
        raise finding(key, team.leader, "expected structure leader: in a mutual team nobody leads")
    if team.leader not in members:
        listed = ", ".join(map(str, members))
        raise finding(key, team.leader, f"expected one of the members {listed}: without a leader Theorem 1 of D fails")


def _check_events(team: TeamSettings, members: Sequence[int]) -> None:
    comings = [one for one in team.events if one.kind is not TeamEventKind.LIES]
    joined = [one.start_sec for one in comings if one.kind is TeamEventKind.JOINS]
    ready = max(joined, default=0.0) + team.settle_sec + team.calibrate_sec
    for index, event in enumerate(team.events):
        key = (*_KEY, "events", index)
        if event.member not in members:
            raise finding((*key, "member"), event.member, f"expected one of {', '.join(map(str, members))}")
        if event.kind is TeamEventKind.LIES and event.start_sec < ready:
            expected = f"expected at least {ready:g}: until then members learn from honest estimates"
            raise finding((*key, "start_sec"), event.start_sec, expected)
    for index, event in enumerate(comings):
        before = [one for one in comings[:index] if one.member == event.member]
        if not before:
            continue
        if event.start_sec <= before[-1].start_sec or event.kind is before[-1].kind:
            expected = "expected joins and leaves of one member in turn, in order of time"
            raise finding((*_KEY, "events", team.events.index(event), "start_sec"), event.start_sec, expected)
