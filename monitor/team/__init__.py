"""Monitors as a team: each measures its neighbourhood, tells what it estimates, and checks what the others tell."""

from monitor.team.designing import Team, TeamDesign, TeamReport, carried_team, design_team
from monitor.team.member import Member, MemberOutput, MemberPhase, MemberState
from monitor.team.plan import Lie, Presence, TeamPlan

__all__ = [
    "Lie",
    "Member",
    "MemberOutput",
    "MemberPhase",
    "MemberState",
    "Presence",
    "Team",
    "TeamDesign",
    "TeamPlan",
    "TeamReport",
    "carried_team",
    "design_team",
]
