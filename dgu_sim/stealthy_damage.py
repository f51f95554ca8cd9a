"""How much harm attacks can do that no unknown-input observer sees, as long as what they claim stays plausible.

The grid is linear, and so is what `uio_stealthy_trajectory` adds to a link. So the answer is a linear programme in the
currents phi_I of all links, over what one ampere on each of them does.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from itertools import permutations

import numpy as np
from scipy.optimize import linprog

from dgu_sim.attacker_knowledge import ScenarioKnowledge
from dgu_sim.errors import AttackError
from dgu_sim.grid import Link
from dgu_sim.linear import FloatArray
from dgu_sim.scenario import Scenario, parse_scenario
from dgu_sim.simulate import Block, simulate

__all__ = ["Damage", "Goal", "Limits", "Responses", "largest_damage", "responses_of", "stealthy_attacks"]

_TIMES = 200  # instants at which the limits are held against references: they move with seconds


class Goal(StrEnum):
    """What is to be as large as possible at the horizon."""

    MEAN_VOLTAGE = "mean_voltage"
    SHARING = "sharing"


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """By how much an input of a DGU may differ from that of the run without attack before it is implausible.

    Attributes:
        load_a: Change of a load current, true or claimed [A].
        load_rate_a: Its change from one sample to the next [A].
        reference_v: Change of V_ref + alpha, true or claimed [V].
        reference_rate_v: Its change from one sample to the next [V].
    """

    load_a: float
    load_rate_a: float
    reference_v: float
    reference_rate_v: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Responses:
    """What 1 A on each link does by the horizon; the last axis numbers the links.

    Attributes:
        links: The links.
        start_sec: First affected sample [s].
        rise_sec: Time of the rise to the whole current [s].
        horizon_sec: From the start to where the damage is taken [s].
        voltage: Changes of the DGUs' voltages at the horizon, shape (DGUs, links) [V/A].
        share: Changes of I_t / I^r there, likewise [1/A].
        alpha: Changes of the DGUs' corrections over time, shape (times, DGUs, links) [V/A].
        claimed: Input that the samples claim on top of the true one, load [A/A] and reference [V/A], over time, shape
            (times, 2, links).
        claimed_rate: Largest change of that from one sample to the next, shape (2, links).
        sources: Position of each link's source among the DGUs.
    """

    links: tuple[Link, ...]
    start_sec: float
    rise_sec: float
    horizon_sec: float
    voltage: FloatArray
    share: FloatArray
    alpha: FloatArray
    claimed: FloatArray
    claimed_rate: FloatArray
    sources: tuple[int, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Damage:
    """The worst attack within the limits.

    Attributes:
        goal: What was made large.
        value: How large: |mean voltage change| [V], or the spread of I_t / I^r between two DGUs.
        currents: phi_I of each link that takes part [A].
        rise_sec: Time of their rise [s].
    """

    goal: Goal
    value: float
    currents: Mapping[Link, float]
    rise_sec: float


def responses_of(scenario: Scenario, start_sec: float, horizon_sec: float, rise_sec: float) -> Responses:
    """Simulate the scenario without attack, and with 1 A on each link.

    Args:
        scenario: Its attacks and its noise are left out.
        start_sec: First affected sample [s].
        horizon_sec: From there to where the damage is taken [s].
        rise_sec: Time of the rise of each current [s].
    """
    calm = _run(scenario, start_sec + horizon_sec, "")
    rated = np.array([dgu.rated_current_a for dgu in scenario.dgus])
    start = round(start_sec / scenario.sampling_period_sec)
    times = np.unique(np.linspace(start, len(calm.x) - 1, _TIMES).round().astype(np.intp))
    knowledge = ScenarioKnowledge(scenario=scenario)
    voltage, share, alpha, claimed, rates = [], [], [], [], []
    for place, link in enumerate(scenario.links):
        run = _run(scenario, start_sec + horizon_sec, _attack(link, 1.0, rise_sec, start_sec))
        moved = run.x[:, 0] - calm.x[:, 0]
        voltage.append(moved[-1, :, 0])
        share.append(moved[-1, :, 1] / rated)
        alpha.append((run.alpha[:, 0] - calm.alpha[:, 0])[times])
        phi = run.received[:, 0, place] - run.y[:, 0, scenario.grid.dgus.index(link.source)]
        A, E = knowledge.model(link.source)
        inputs = (phi[1:] - phi[:-1] @ A.T) @ np.linalg.pinv(E).T
        claimed.append(inputs[np.minimum(times, len(inputs) - 1)])
        rates.append(np.abs(np.diff(inputs, axis=0)).max(axis=0))
    return Responses(
        links=scenario.links,
        start_sec=start_sec,
        rise_sec=rise_sec,
        horizon_sec=horizon_sec,
        voltage=np.stack(voltage, axis=-1),
        share=np.stack(share, axis=-1),
        alpha=np.stack(alpha, axis=-1),
        claimed=np.stack(claimed, axis=-1),
        claimed_rate=np.stack(rates, axis=-1),
        sources=tuple(scenario.grid.dgus.index(link.source) for link in scenario.links),
    )


def largest_damage(responses: Responses, limits: Limits, goal: Goal) -> Damage:
    """Return the currents that do the largest damage while everything that anybody can reconstruct is plausible.

    Plausible are, at every time: the load that each link claims, and its change from sample to sample; the reference
    that each link claims, which is the true one of its source (moved by the attack) plus what the attack adds; every
    DGU's true reference, which its honest links show.

    Raises:
        AttackError: A limit is not positive.
    """
    within, limit = _constraints(responses, limits)
    if goal is Goal.MEAN_VOLTAGE:
        directions = [responses.voltage.mean(axis=0)]
    else:
        shares = responses.share
        directions = [shares[one] - shares[other] for one, other in permutations(range(len(shares)), 2)]
    best = max((_maximum(direction, within, limit) for direction in directions), key=lambda found: found[0])
    value, currents = best
    return Damage(
        goal=goal,
        value=value,
        currents={
            link: float(current)
            for link, current in zip(responses.links, currents, strict=True)
            if abs(current) > _NEGLIGIBLE * np.abs(currents).max()
        },
        rise_sec=responses.rise_sec,
    )


def stealthy_attacks(damage: Damage, start_sec: float) -> str:
    """Return the attacks as the value of a scenario's `attacks`."""
    attacks = [_attack(link, current, damage.rise_sec, start_sec) for link, current in damage.currents.items()]
    return f"[{', '.join(attacks)}]"


_NEGLIGIBLE = 1e-6  # share of the largest current below which a link takes no part


def _constraints(responses: Responses, limits: Limits) -> tuple[FloatArray, FloatArray]:
    """Return rows and limits: |rows phi_I| <= limits."""
    count = len(responses.links)
    rows: list[FloatArray] = []
    bounds: list[float] = []

    def hold(coefficients: FloatArray, bound: float) -> None:
        if bound <= 0.0:
            raise AttackError(f"limit {bound:g}: expected a positive number")
        flat = coefficients.reshape(-1, count)
        rows.append(flat)
        bounds.extend([bound] * len(flat))

    own = np.eye(count)
    hold(np.abs(responses.claimed[:, 0]).max(axis=0)[:, np.newaxis] * own, limits.load_a)
    hold(responses.claimed_rate[0][:, np.newaxis] * own, limits.load_rate_a)
    hold(responses.claimed_rate[1][:, np.newaxis] * own, limits.reference_rate_v)
    hold(responses.alpha, limits.reference_v)
    for place, source in enumerate(responses.sources):
        claimed = responses.alpha[:, source].copy()
        claimed[:, place] += responses.claimed[:, 1, place]
        hold(claimed, limits.reference_v)
    return np.concatenate(rows), np.array(bounds)


def _maximum(direction: FloatArray, within: FloatArray, limit: FloatArray) -> tuple[float, FloatArray]:
    found = linprog(
        -direction,
        A_ub=np.concatenate([within, -within]),
        b_ub=np.concatenate([limit, limit]),
        bounds=[(None, None)] * len(direction),
    )
    if not found.success:
        raise AttackError(f"the largest damage cannot be computed: {found.message}")
    currents = np.asarray(found.x)
    return float(direction @ currents), currents


def _attack(link: Link, current: float, rise_sec: float, start_sec: float) -> str:
    numbers = f"current_a: {current!r}, rise_sec: {rise_sec}, knowledge: model, start_sec: {start_sec}"
    return f"{{kind: uio_stealthy_trajectory, link: {link}, {numbers}}}"


def _run(scenario: Scenario, duration_sec: float, attack: str) -> Block:
    changes = (f"attacks=[{attack}]", f"duration_sec={duration_sec}", "noise={kind: none}")
    run = parse_scenario(scenario.to_yaml(), overrides=changes)
    (block,) = simulate(run, block_steps=run.steps)
    return block
