"""A team of monitors on a plant of their own: what the proof says, who is there, what a member starts from."""

from __future__ import annotations

import json
from dataclasses import replace
from math import nan

import numpy as np
import pytest
from numpy.typing import NDArray

from monitor.errors import MonitorError
from monitor.history import Experiment, History
from monitor.team import Lie, MemberOutput, MemberPhase, MemberState, Presence, TeamDesign, TeamPlan, design_team

Floats = NDArray[np.float64]

# A chain of four units of three states and two inputs each; states move neighbours through the first one.
UNITS = (3, 5, 8, 9)
PAIRS = ((3, 5), (5, 8), (8, 9))
HEARD = {3: (3, 5), 5: (3, 5, 8), 8: (5, 8, 9), 9: (8, 9)}


def plant(last: float = 0.9) -> tuple[Floats, Floats]:
    """A (12, 12) and E (12, 8); `last` is the spectral radius of the last unit, which no other one feels."""
    A, E = np.zeros((12, 12)), np.zeros((12, 8))
    for at in range(4):
        own = slice(3 * at, 3 * at + 3)
        A[own, own] = [[0.5, 0.2, 0.1], [-0.2, 0.6, 0.3], [0.1, -0.1, 0.7]]
        E[own, 2 * at : 2 * at + 2] = [[1.0, 0.1], [0.2, 1.0], [0.3, 0.2]]
        for other in (at - 1, at + 1):
            if 0 <= other < 4:
                A[3 * at, 3 * other] = 0.1
    A[9:, 9:] *= last / np.max(np.abs(np.linalg.eigvals(A[9:, 9:])))
    A[6, 9] = 0.0
    return A, E


def record(A: Floats, E: Floats, steps: int = 60, seed: int = 4) -> tuple[Floats, Floats]:
    """States (steps, 12) and inputs (steps, 8) from random ones."""
    generator = np.random.default_rng(seed)
    u = generator.uniform(-1.0, 1.0, (steps, 8))
    rows = [generator.uniform(-1.0, 1.0, 12)]
    for inputs in u[:-1]:
        rows.append(A @ rows[-1] + E @ inputs)
    return np.array(rows), u


def history(A: Floats, E: Floats) -> History:
    """Short experiments on the whole plant, because it may be unstable."""
    parts = [record(A, E, 6, seed) for seed in range(20)]
    return History(tuple(Experiment(u, x, x) for x, u in parts), 0.1)


PLAN = TeamPlan(
    members=UNITS,
    heard=HEARD,
    links=PAIRS,
    announced=(True, True),
    structure="mutual",
    leader=None,
    chi=None,
    sampling_period_sec=0.1,
    detector={"settle_sec": 1.0, "calibrate_sec": 1.0, "floor": (0.01, 0.01, 0.01)},
)


def play(
    made: TeamDesign, plan: TeamPlan, x: Floats, u: Floats, lost: frozenset[int] = frozenset()
) -> list[list[MemberOutput]]:
    """What all members tell, step by step; the second one's samples are lost at some steps."""
    states: list[MemberState] = [one.init() for one in made.members]
    told: list[MemberOutput] = []
    rows = []
    for step, truth in enumerate(x):
        outputs = []
        for at, member in enumerate(plan.members):
            y = truth[plan.measured(member)].tolist()
            if at == 1 and step in lost:
                y[0] = nan
            known = u[step - 1, plan.known_inputs(member)].tolist()
            others = [told[plan.members.index(one)].told if told else None for one in plan.neighbours(member)]
            states[at], output = made.members[at].step(states[at], y, known, others)
            outputs.append(output)
        told = outputs
        rows.append(outputs)
    return rows


def errors(rows: list[list[MemberOutput]], x: Floats) -> Floats:
    """Largest error of each member, (steps, members)."""
    return np.array(
        [[np.max(np.abs(np.array(one.estimate) - truth)) for one in row] for row, truth in zip(rows, x, strict=True)]
    )


def test_the_team_converges_at_the_radius_that_its_phases_prove() -> None:
    """The step that estimates travel does not change the rate: the error after k steps is radius**k of the first."""
    made = design_team(PLAN, history(*plant()))
    assert made.accepted, made.verdict
    x, u = record(*plant())
    found = errors(play(made, PLAN, x, u), x)
    (phase,) = made.report.phases
    assert (phase.from_step, phase.present, phase.connected) == (0, UNITS, True)
    # a transient factor of 100 for dynamics that are not normal, and rounding
    assert np.all(found[40] < 100.0 * phase.radius**40 * found[0].max() + 1e-12)
    report = json.loads(made.report.to_json())
    assert np.array(report["harm"]).shape == (4, 3, 3)
    assert all(radius < 1.0 for radius in report["isolated"])


def test_who_is_not_there_says_so_and_is_not_waited_for() -> None:
    """Before joining, after leaving and while a sample is missing a member is ABSENT; the others go on."""
    plan = replace(PLAN, presence=(Presence(10, 3, there=True), Presence(30, 9, there=False)))
    made = design_team(plan, history(*plant()))
    assert [one.present for one in made.report.phases] == [(5, 8, 9), UNITS, (3, 5, 8)]
    x, u = record(*plant())
    rows = play(made, plan, x, u, lost=frozenset({40, 41}))
    there = np.array([[one.phase == MemberPhase.PRESENT for one in row] for row in rows])
    assert there[:, 0].tolist() == [step >= 10 for step in range(60)]
    assert there[:, 3].tolist() == [step < 30 for step in range(60)]
    assert there[:, 1].tolist() == [step not in {40, 41} for step in range(60)]
    found = errors(rows, x)
    # back from the two lost samples it starts from what others told: one step of the plant away from the truth
    assert found[42, 1] < 2.0
    assert np.nanmax(found[59]) < 1e-2
    assert rows[41][1].told is None


def test_a_lie_is_accused_at_once_and_left_out() -> None:
    """The neighbours of the liar accuse it for its first false estimate; nobody else's estimate moves."""
    plan = replace(PLAN, lies=(Lie(5, 50, 55, (0.5, 0.0, 0.0)),))
    made = design_team(plan, history(*plant()))
    x, u = record(*plant())
    rows = play(made, plan, x, u)
    accused = {(step, UNITS[at]) for step, row in enumerate(rows) for at, one in enumerate(row) if any(one.alarm)}
    assert accused == {(step, one) for step in range(51, 56) for one in (3, 8)}
    assert all(rows[51][at].alarm[1] for at in (0, 2))
    found = errors(rows, x)
    assert np.allclose(found[50:55, 1], 0.5, atol=1e-4)
    assert np.max(found[50:, [0, 2, 3]]) < 1e-4


def test_who_remains_must_converge_alone() -> None:
    """An unstable unit that only 8 and 9 see: with them the team follows it, without them it is refused beforehand."""
    unstable = history(*plant(last=1.05))
    assert design_team(PLAN, unstable).accepted
    left = replace(PLAN, presence=(Presence(20, 8, there=False), Presence(20, 9, there=False)))
    made = design_team(left, unstable)
    assert not made.accepted
    assert "from step 20 on, with members 3, 5 alone, the spectral radius of their errors is 1." in made.verdict
    assert {one.step(one.init(), (), (), ())[1].phase for one in made.members} == {MemberPhase.REFUSED}


def test_a_leader_that_cannot_see_an_unstable_unit_is_refused_by_condition_19() -> None:
    """Theorem 1 of D needs a member that can lead: member 3 does not hear the unstable unit, member 9 does."""
    unstable = history(*plant(last=1.05))
    blind = design_team(replace(PLAN, structure="leader", leader=3), unstable)
    assert not blind.accepted
    assert "node 1 cannot lead: condition (19) of D fails" in blind.verdict


def test_inputs_that_nobody_announces_are_refused_by_condition_18() -> None:
    """What acts on a unit that a member does not hear shows in none of its outputs at once."""
    made = design_team(replace(PLAN, announced=(False, True)), history(*plant()))
    assert not made.accepted
    assert "condition (18) of D fails" in made.verdict


def test_options_that_do_not_fit_raise() -> None:
    """A mutual team has no leader."""
    with pytest.raises(MonitorError, match="no leader"):
        design_team(replace(PLAN, leader=3), history(*plant()))
