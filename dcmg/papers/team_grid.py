"""The team of monitors as the product runs it, in numbers: structures, couplings, noise, attacks, cost.

Everything is simulated through the scenario `team_six_dgu` and the code of its nodes, without ROS; the run over ROS is
the same bit for bit.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import process_time
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from bags.watch.histories import grid_history_of_run
from bags.watch.monitors import link_monitors
from bags.watch.scenarios import load_scenario
from bags.watch.team import RunTeam, plan_of
from bags.wire.convert import history_of
from bags.wire.schema import run_topics
from dcmg.papers.check import Check
from dcmg.shipped import scenario_path
from dgu_sim.simulate import simulate
from monitor.team import design_team

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from bags.watch.team_record import TeamArrays
    from dgu_sim.scenario import Scenario

QUIET = ("monitor.team.events=[]", "attacks=[]")
NOISE = "noise={kind: gaussian, std: [0.01, 0.01, 0.001]}"
DESIGNS = {
    "mutual": (),
    "leader": ("monitor.team.structure=leader", "duration_sec=24.0"),
    "mutual, joint grid": ("coupling=joint",),
    "mutual, noise on outputs": (NOISE,),
    "leader, noise on outputs": ("monitor.team.structure=leader", "duration_sec=24.0", NOISE),
    "mutual, float32 history": ("history.precision=float32",),
    "mutual, noise 1e-5 on the history": ("history.noise_std=0.00001",),
    "mutual, noise 1e-4 on the history": ("history.noise_std=0.0001",),
}
START = 6.0  # of the attacks [s]
ATTACKS = {
    "bias of 0.1 V, 0.1 A, 0.1 V s": "kind: bias, bias: [0.1, 0.1, 0.1]",
    "stealthy plane, 0.5 V": "kind: uio_stealthy_plane, voltage_v: 0.5",
    "stealthy trajectory to 0.5 V, 1 A": "kind: uio_stealthy_trajectory, voltage_v: 0.5, current_a: 1.0",
    "replay of the last second": "kind: replay, record_sec: 1.0",
    "no delivery for 1 s": "kind: drop, stop_sec: 7.0",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignRow:
    """One way to set the team up.

    Attributes:
        name: what is set.
        verdict: of the design.
        radius: spectral radius of the errors of the whole team.
        misfit: largest misfit of (20) among the members: what taking next values for derivatives costs.
        error: (3,) largest |xhat - x| of V [V], I_t [A], v [V s] of any member in the last second.
        harm: (3,) largest steady error of V, I_t, v from a lie of 1 V that nobody leaves out.
        curve: (steps,) largest |xhat - x| of any state and member.
    """

    name: str
    verdict: str
    radius: float
    misfit: float
    error: NDArray[np.float64]
    harm: NDArray[np.float64]
    curve: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class AttackRow:
    """One attack on link 1-2 of the mutual team on exact data.

    Attributes:
        name: what is done.
        link_sec: from its start to the first alarm of the link's own monitor [s], NaN: never.
        team_sec: from its start to the first accusation [s], NaN: never.
        accused: who accuses whom in the first second.
        victim: largest |xhat - x| of any state at member 2.
        others: the same at all others.
    """

    name: str
    link_sec: float
    team_sec: float
    accused: tuple[tuple[int, int], ...]
    victim: float
    others: float


@dataclass(frozen=True, slots=True, kw_only=True)
class TeamResult:
    """The study.

    Attributes:
        period_sec: T_s [s].
        designs: one row a setting.
        attacks: one row an attack.
        step_us: processor time of one step of one member, on average [us].
        message_bytes: length of one estimate on the wire.
    """

    period_sec: float
    designs: tuple[DesignRow, ...]
    attacks: tuple[AttackRow, ...]
    step_us: float
    message_bytes: int


def run(seed: int = 1, designs: Sequence[str] = tuple(DESIGNS), attacks: Sequence[str] = tuple(ATTACKS)) -> TeamResult:
    """Simulate every setting and every attack."""
    rows = [_design(name, _scenario(seed, "duration_sec=8.0", *QUIET, *DESIGNS[name])) for name in designs]
    scenario = _scenario(seed, *QUIET)
    topics = run_topics(scenario.grid.dgus, scenario.links, scenario.sampling_period_ns, team=True)
    layout = topics.team.estimate(1).layout if topics.team else None
    return TeamResult(
        period_sec=scenario.sampling_period_sec,
        designs=tuple(row for row, _ in rows),
        attacks=tuple(_attack(name, seed) for name in attacks),
        step_us=float(np.mean([step for row, step in rows if not np.isnan(row.radius)])),
        message_bytes=0 if layout is None else layout.size,
    )


def checks(result: TeamResult) -> list[Check]:
    """Without noise every member's error of every state vanishes; the stealthy attack shows in the team alone."""
    found = [
        # rounding of the 18 states, up to 50 in size, through gains of 20
        Check(name=f"last error, {row.name}", value=float(np.max(row.error)), expected=0.0, tolerance=1e-6)
        for row in result.designs
        if "noise" not in row.name and "float32" not in row.name
    ]
    for one in result.attacks:
        if "trajectory" in one.name:
            missed = float(np.isnan(one.link_sec))
            found.append(Check(name="stealthy attack missed by its link", value=missed, expected=1.0, tolerance=0.0))
            found.append(Check(name="seen by the team after [s]", value=one.team_sec, expected=0.0, tolerance=0.1))
            found.append(Check(name="harm to the others", value=one.others, expected=0.0, tolerance=1e-6))
    return found


def notes(result: TeamResult) -> list[str]:
    """Both tables, and the cost."""
    lines = ["", "| team | radius | to 1 % [s] | misfit of the data | last error V, I_t, v | harm of a lie of 1 V |"]
    lines.append("|---|---|---|---|---|---|")
    for row in result.designs:
        if np.isnan(row.radius):
            lines.append(f"| {row.name} | {row.verdict:.100} ... | | | | |")
            continue
        seconds = result.period_sec * np.log(0.01) / np.log(row.radius)
        error, harm = (", ".join(f"{one:.1e}" for one in vector) for vector in (row.error, row.harm))
        lines.append(f"| {row.name} | {row.radius:.4f} | {seconds:.2f} | {row.misfit:.1e} | {error} | {harm} |")
    lines += [
        "",
        "| attack on link 1-2 | link alarm after [s] | team after [s] | who accuses whom | error of 2 | of others |",
    ]
    lines.append("|---|---|---|---|---|---|")
    for one in result.attacks:
        seen = ["never" if np.isnan(delay) else f"{delay:.2f}" for delay in (one.link_sec, one.team_sec)]
        pairs = " ".join(f"{who}:{whom}" for who, whom in one.accused) or "nobody"
        lines.append(f"| {one.name} | {' | '.join(seen)} | {pairs} | {one.victim:.1e} | {one.others:.1e} |")
    lines += [
        "",
        f"One step of one member {result.step_us:.0f} us, one estimate on the wire {result.message_bytes} bytes.",
    ]
    return lines


def plot(result: TeamResult, out_dir: Path) -> list[Path]:
    """Draw the largest error of any member for every setting."""
    out_dir.mkdir(parents=True, exist_ok=True)
    figure = Figure(figsize=(9.0, 4.5), layout="constrained")
    axes = figure.subplots()
    for row in result.designs:
        t = np.arange(len(row.curve)) * result.period_sec
        axes.semilogy(t, np.maximum(row.curve, 1e-13), linewidth=1.2, label=row.name)
    axes.set(xlabel="t [s]", ylabel="largest |x - xhat| of any member (V, A, V s)")
    axes.legend(fontsize="small", loc="upper right")
    path = out_dir / "team_grid.png"
    figure.savefig(path, dpi=120)
    return [path]


def _scenario(seed: int, *changes: str) -> Scenario:
    return load_scenario(scenario_path("team_six_dgu"), [f"seed={seed}", *changes])


@dataclass(frozen=True, slots=True, kw_only=True)
class _Simulated:
    """What one run of a team came to.

    Attributes:
        told: what was told.
        apart: (steps, members, 18) |told - true|.
        alarm: (steps, links) of the link monitors.
        step_us: a step of a member.
        verdict, radius, misfit, harm: of the design, see DesignRow.
    """

    told: TeamArrays
    apart: NDArray[np.float64]
    alarm: NDArray[np.bool_]
    step_us: float
    verdict: str
    radius: float
    misfit: float
    harm: NDArray[np.float64]


def _simulated(scenario: Scenario) -> _Simulated:
    topics = run_topics(scenario.grid.dgus, scenario.links, scenario.sampling_period_ns, team=True)
    if topics.team is None:
        raise TypeError("a scenario without a team")
    plan = plan_of(scenario, topics.team)
    made = design_team(plan, history_of(grid_history_of_run(scenario)))
    team = RunTeam(topics=topics.team, plan=plan, team=made.team)
    (block,) = simulate(scenario, block_steps=scenario.steps)
    positions = [topics.dgus.index(dgu) for dgu in topics.team.announcing]
    inputs = np.stack([block.load_current[:, 0, positions], block.reference[:, 0, positions]], axis=-1)
    began = process_time()
    _, told = team.run(team.init(), block.y[:, 0], block.received[:, 0], inputs)
    step_us = 1e6 * (process_time() - began) / (scenario.steps * len(topics.dgus))
    monitors = link_monitors(scenario)
    _, outputs = monitors.run(monitors.init(), block.received[:, 0], block.delivered[:, 0])
    report = made.report
    return _Simulated(
        told=told,
        apart=np.abs(told.estimate - block.x[:, 0].reshape(scenario.steps, 1, -1)),
        alarm=outputs.alarm,
        step_us=step_us,
        verdict=made.verdict,
        radius=report.network.stability or np.nan,
        misfit=max(report.network.misfit, default=np.nan),
        harm=np.max(np.array(report.harm)[:, 0], axis=0) if report.harm else np.full(3, np.nan),
    )


def _design(name: str, scenario: Scenario) -> tuple[DesignRow, float]:
    found = _simulated(scenario)
    last = found.apart[-round(1.0 / scenario.sampling_period_sec) :]
    row = DesignRow(
        name=name,
        verdict=found.verdict,
        radius=found.radius,
        misfit=found.misfit,
        error=np.array([np.max(last[..., kind::3]) for kind in range(3)]),
        harm=found.harm,
        curve=np.max(found.apart, axis=(1, 2)),
    )
    return row, found.step_us


def _attack(name: str, seed: int) -> AttackRow:
    scenario = _scenario(
        seed, "duration_sec=9.0", QUIET[0], f"attacks=[{{{ATTACKS[name]}, link: 1-2, start_sec: {START}}}]"
    )
    found = _simulated(scenario)
    start, dgus = round(START / scenario.sampling_period_sec), scenario.grid.dgus
    link = [str(one) for one in scenario.links].index("1-2")
    by_link = np.flatnonzero(found.alarm[start:, link])
    accused = found.told.alarm[start:]
    by_team = np.flatnonzero(accused.any(axis=(1, 2)))
    early = accused[: round(1.0 / scenario.sampling_period_sec)].any(axis=0)
    worst = np.nanmax(found.apart[start:], axis=(0, 2))
    return AttackRow(
        name=name,
        link_sec=float(by_link[0]) * scenario.sampling_period_sec if len(by_link) else np.nan,
        team_sec=float(by_team[0]) * scenario.sampling_period_sec if len(by_team) else np.nan,
        accused=tuple((dgus[one], dgus[two]) for one, two in np.argwhere(early)),
        victim=float(worst[dgus.index(2)]),
        others=float(np.max(np.delete(worst, dgus.index(2)))),
    )
