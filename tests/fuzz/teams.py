"""Trials of the distributed observers: D's design in continuous and in sampled form, and a team on a grid of DGUs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from monitor.distributed import design, linked
from monitor.distributed.gains import error_dynamics
from monitor.history import Experiment, History
from monitor.team import TeamPlan, design_team
from tests.fuzz.grids import Grid, GridUnits, Log, draw_grid, draw_log, violation
from tests.fuzz.judge import Outcome, Result, refusal
from tests.fuzz.observers import generator_of
from tests.fuzz.oracle import Answer, Evidence, Truth, judged_margin
from tests.fuzz.plants import rank_of
from tests.fuzz.zeros import half_plane_margin, zero_margins

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

_EXACT = 1e-6
_GROSS = 1e-2
_NOISY = 0.5
_NOTHING = 1e-10


def try_distributed(kind: str, seed: int) -> Result:
    """Design "distributed/sampled" or "distributed/continuous" and hold D (8) against the true matrices."""
    generator = generator_of(kind, seed)
    discrete = kind.endswith("sampled")
    grid = draw_grid(generator, discrete=discrete)
    log, nodes = draw_log(generator, grid), range(len(grid.C))
    options: dict[str, object] = {}
    if discrete and generator.random() < 0.5:
        options["structure"] = "mutual"
    if generator.random() < 0.3 or log.quality != "exact":
        options["unknown_inputs"] = tuple(rank_of(grid.unknown(i)) for i in nodes)
    ring = [(i, (i + 1) % len(grid.C)) for i in nodes]
    data = [log.regressors(grid, i, discrete=discrete) for i in nodes]
    made = design(data, linked(len(grid.C), ring), options)
    truth = distributed_truth(grid, log, discrete=discrete, led=options.get("structure") != "mutual")
    if not made.accepted:
        outcome, detail = refusal(truth, made.verdict)
        if outcome in {Outcome.MISSED, Outcome.UNSAID} and "chi = " in made.verdict:
            outcome = Outcome.STRATEGY
    else:
        reached = float(made.report.stability or 0.0)
        off = max(violation(grid, i, one, log.units, discrete=discrete) for i, one in enumerate(made.gains))
        limit = min(max(_EXACT, 1e3 * truth.doubt), _GROSS if log.quality == "exact" else _NOISY)
        outcome = Outcome.DISPUTED if truth.answer is Answer.NO else Outcome.RIGHT
        if off > limit or reached >= (1.0 if discrete else 0.0):
            outcome = Outcome.WRONG
        detail = f"{made.verdict} | D (8) within {off:.1e}, allowed {limit:.0e} | {truth.why}"
    sizes = f"n={len(grid.A)} m={grid.B.shape[1]} outputs={[len(C) for C in grid.C]} {len(log.x)} columns"
    words = f"{sizes} {log.quality} {log.error:.0e}{log.units.in_words} {options}"
    return Result(kind=kind, seed=seed, outcome=outcome, detail=f"{words}: {detail}")


def distributed_truth(grid: Grid, log: Log, *, discrete: bool, led: bool) -> Truth:
    """Rank C Bbar = rank Bbar for every node; a leader whose zeros are stable; everything excited."""
    n, m = grid.B.shape
    margin, leaders = 1.0, []
    for node, C in enumerate(grid.C):
        Bbar = _range(grid.unknown(node))
        if Bbar.shape[1]:
            seen = np.linalg.svd(C @ Bbar, compute_uv=False)
            margin = min(margin, float(seen[-1]) if len(C) >= Bbar.shape[1] else 0.0)
        zero = np.zeros((len(C), Bbar.shape[1]))
        margins = zero_margins(grid.A, Bbar, C, zero, 1.0).least if discrete else half_plane_margin(grid.A, Bbar, C)
        leaders.append(margins)
    data = Evidence(error=log.error * log.condition, spare=len(log.x) - n - m, span=n + m)
    if margin < _NOTHING:
        return judged_margin(data, Answer.NO, 1.0, "rank C Bbar < rank Bbar at a node")
    best = max(leaders) if led else 1.0
    why = f"margins: rank {margin:.1e}, leader {best:.1e}"
    # a sampled network has no condition for chi, so only a continuous one must be found
    return judged_margin(data, Answer.YES if led and not discrete else Answer.OPEN, min(margin, best), why)


def _range(Bbar: Floats) -> Floats:
    """Orthonormal basis of its columns."""
    if not Bbar.shape[1]:
        return Bbar
    left, values, _ = np.linalg.svd(Bbar, full_matrices=False)
    return left[:, values > 1e-9 * values[0]]


def try_team(kind: str, seed: int) -> Result:
    """Two to four DGUs of three states: the gains of accepted members obey D (8), and their errors converge."""
    generator = generator_of(kind, seed)
    count = int(generator.integers(2, 5))
    plan = _plan(generator, count)
    A, B = _chain(generator, count)
    n, m = B.shape
    natural = generator.random() < 0.6
    x_units, u_units = (np.ones(one) if natural else 10.0 ** generator.uniform(-6.0, 6.0, one) for one in (n, m))
    made = design_team(plan, _history(generator, A, B, (x_units, u_units)))
    measured = tuple(plan.measured(member) for member in plan.members)
    grid = Grid(
        A=A,
        B=B,
        C=tuple(np.eye(n)[one] for one in measured),
        known=tuple(plan.known_inputs(member) for member in plan.members),
    )
    units = GridUnits(x=x_units, u=u_units, y=tuple(x_units[one] for one in measured))
    margin = min(float(np.linalg.svd(C @ grid.unknown(at), compute_uv=False)[-1]) for at, C in enumerate(grid.C))
    data = Evidence(error=1e-14, spare=3 * (n + m), span=n + m)
    answer = Answer.NO if margin < _NOTHING else Answer.OPEN  # no condition for chi
    truth = judged_margin(data, answer, max(margin, 1e-3), f"rank margin {margin:.1e}")
    words = f"{count} members {plan.structure} announced {plan.announced}{units.in_words}"
    if not made.accepted:
        outcome, detail = refusal(truth, made.verdict)
        outcome = Outcome.OPEN if outcome is Outcome.UNSAID else outcome
        return Result(kind=kind, seed=seed, outcome=outcome, detail=f"{words}: {detail}")
    gains = [member.observer.gains for member in made.members if member.observer is not None]
    off = max(violation(grid, at, one, units, discrete=True) for at, one in enumerate(gains))
    radius = float(np.max(np.abs(np.linalg.eigvals(error_dynamics(gains, plan.network)))))
    outcome = Outcome.DISPUTED if truth.answer is Answer.NO else Outcome.RIGHT
    if radius >= 1.0 or off > _EXACT:
        outcome = Outcome.WRONG
    told = f"{words}: {made.verdict} | D (8) within {off:.1e}, radius {radius:.4g} | {truth.why}"
    return Result(kind=kind, seed=seed, outcome=outcome, detail=told)


def _plan(generator: np.random.Generator, count: int) -> TeamPlan:
    """A chain of members that hear their neighbours; what they do not hear is announced, or not."""
    members = tuple(sorted(int(one) + 1 for one in generator.permutation(9)[:count]))
    return TeamPlan(
        members=members,
        heard={members[at]: members[max(at - 1, 0) : at + 2] for at in range(count)},
        links=tuple((members[at], members[at + 1]) for at in range(count - 1)),
        announced=(True, True) if generator.random() < 0.85 else (bool(generator.integers(2)), False),
        structure="mutual" if generator.random() < 0.6 else "leader",
        leader=None,
        chi=None,
        sampling_period_sec=0.1,
        detector={},
    )


def _chain(generator: np.random.Generator, count: int) -> tuple[Floats, Floats]:
    """A and B of DGUs in a row, each moved by its neighbours' first states and two inputs of its own."""
    A, B = np.zeros((3 * count, 3 * count)), np.zeros((3 * count, 2 * count))
    for at in range(count):
        own, block = slice(3 * at, 3 * at + 3), generator.standard_normal((3, 3))
        A[own, own] = block * generator.uniform(0.3, 1.03) / np.max(np.abs(np.linalg.eigvals(block)))
        B[own, 2 * at : 2 * at + 2] = generator.standard_normal((3, 2))
        for other in {at - 1, at + 1} & set(range(count)):
            A[3 * at, 3 * other] = generator.uniform(-0.2, 0.2)
    return A, B


def _history(generator: np.random.Generator, A: Floats, B: Floats, units: tuple[Floats, Floats]) -> History:
    """Short experiments on the whole grid: it may be unstable."""
    (n, m), samples, parts = B.shape, 6, []
    for _ in range(-(-3 * (n + m) // (samples - 1))):
        u, x = generator.uniform(-1.0, 1.0, (samples, m)), [generator.uniform(-1.0, 1.0, n)]
        for inputs in u[:-1]:
            x.append(A @ x[-1] + B @ inputs)
        states = np.array(x) * units[0]
        parts.append(Experiment(u * units[1], states, states))
    return History(tuple(parts), 0.1)
