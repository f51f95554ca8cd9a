"""What a response avoids: the same scenario simulated with it and without, step for step the same but for it."""

from dataclasses import dataclass, fields

import numpy as np

from bags.mcap.errors import BagError
from bags.runs.following import follow
from bags.watch.combined_arrays import CombinedArrays, CombinedFields
from bags.watch.designs import design_scenario
from bags.watch.histories import recorded_states
from bags.wire.forms import MASKS
from bags.wire.schema import RunTopics
from bags.wire.settings import settings_of
from dgu_sim.grid import Link
from dgu_sim.scenario import Scenario
from dgu_sim.simulate import Block, simulate
from monitor.measures import GridImpact, grid_impact

_REASONS = tuple(name for name in MASKS if name.startswith("by_"))
_BLOCK_STEPS = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class FirstAccusation:
    """When a link was first accused.

    Attributes:
        link: The link.
        step: The step.
        reasons: Fields of Verdict.msg that say why: by_residual, by_plausibility, by_stream, by_local.
    """

    link: Link
    step: int
    reasons: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Avoided:
    """A scenario with its response and without it.

    Attributes:
        sampling_period_sec: T_s.
        with_response: How far the grid is from its goals at each step.
        without: The same when nobody acts on a verdict.
        accused: The links that the run with the response accused, by time.
    """

    sampling_period_sec: float
    with_response: GridImpact
    without: GridImpact
    accused: tuple[FirstAccusation, ...]


def compare_response(scenario: Scenario) -> Avoided:
    """Simulate a scenario with its response and without it; the attacks are those that the scenario schedules.

    Raises:
        BagError: The scenario has no response, or its histories cannot be read.
        monitor.errors.MonitorError: Unknown kind or option.
    """
    if settings_of(scenario).response is None:
        raise BagError(f"scenario {scenario.name} has no monitor.response, expected one to compare with doing nothing")
    designs = design_scenario(scenario)
    topics = designs.topics
    calm, said = [], []
    for block, _, combined in follow(scenario, designs, recorded_states(scenario), _BLOCK_STEPS):
        calm.append(_impact(scenario, block))
        said.append(_said(combined, topics))
    return Avoided(
        sampling_period_sec=scenario.sampling_period_sec,
        with_response=_joined(calm),
        without=without_response(scenario),
        accused=_first(said, topics),
    )


def without_response(scenario: Scenario) -> GridImpact:
    """Simulate a scenario in which no verdict is acted on: what the monitors would say changes nothing.

    Raises:
        BagError: The histories that its attackers know cannot be read.
    """
    blocks = simulate(scenario, block_steps=_BLOCK_STEPS, recorded=recorded_states(scenario))
    return _joined([_impact(scenario, block) for block in blocks])


def _said(combined: CombinedFields | None, topics: RunTopics) -> CombinedArrays:
    assert topics.combined is not None  # noqa: S101 - a response makes it so
    assert combined is not None  # noqa: S101 - idem
    return combined.arrays(topics.combined)


def _impact(scenario: Scenario, block: Block) -> GridImpact:
    rated = np.array([one.rated_current_a for one in scenario.dgus])
    nominal = block.reference[:, 0] - block.alpha[:, 0]
    return grid_impact(block.x[:, 0, :, 0], block.x[:, 0, :, 1], nominal, rated)


def _joined(parts: list[GridImpact]) -> GridImpact:
    return GridImpact(**{one.name: np.concatenate([getattr(p, one.name) for p in parts]) for one in fields(GridImpact)})


def _first(said: list[CombinedArrays], topics: RunTopics) -> tuple[FirstAccusation, ...]:
    accused = np.concatenate([one.verdict.accused for one in said])
    found = []
    for position in np.flatnonzero(accused.any(axis=0)).tolist():
        step = int(np.argmax(accused[:, position]))
        reasons = tuple(
            name for name in _REASONS if np.concatenate([getattr(one.verdict, name)[:, position] for one in said])[step]
        )
        found.append(FirstAccusation(link=topics.links[position], step=step, reasons=reasons))
    return tuple(sorted(found, key=lambda one: (one.step, one.link.target, one.link.source)))
