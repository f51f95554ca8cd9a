"""What a response avoids."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bags.mcap.errors import BagError
from bags.runs.avoided import compare_response
from bags.watch.scenarios import load_scenario
from dgu_sim.scenario import Scenario

SCENARIOS = Path(__file__).parents[3] / "dcmg" / "scenarios"
START = 300
# equal loads: secondary control has nothing to do, so a few seconds are enough to learn from
CALM = tuple(f"dgus.{number}.load=[{{kind: constant, current_a: 12.0}}]" for number in range(6))


@pytest.fixture(name="scenario")
def _scenario() -> Callable[..., Scenario]:
    def load(*overrides: str) -> Scenario:
        limits = "monitor.plausibility.limits={settle_sec: 0.5, calibrate_sec: 2.0, range: [0.4, 0.1]}"
        short = ("duration_sec=5", limits, "attacks.0.start_sec=3.0", *CALM)
        return load_scenario(SCENARIOS / "gallo_six_dgu_combined.yaml", (*short, *overrides))

    return load


def test_the_same_until_the_first_accusation_and_much_less_afterwards(scenario: Callable[..., Scenario]) -> None:
    """With and without are the same run until a link is accused; then the grid stays, or is moved."""
    found = compare_response(scenario())
    (first,) = found.accused
    assert (str(first.link), first.reasons) == ("1-2", ("by_plausibility",))
    assert START < first.step < START + 100
    for name in ("mean_voltage", "voltage", "sharing"):
        calm, alone = getattr(found.with_response, name), getattr(found.without, name)
        assert len(calm) == len(alone) == 500
        np.testing.assert_array_equal(calm[: first.step + 1], alone[: first.step + 1])
        assert np.abs(calm[START:]).max() < 0.1 * np.abs(alone[START:]).max()


def test_a_second_publisher_is_accused_by_its_stream(scenario: Callable[..., Scenario]) -> None:
    """Whatever it says, a second publisher is a reason of its own; what it tries to move is not moved."""
    spoof = "attacks=[{kind: spoof, link: 1-2, start_sec: 3.0, falsify: {kind: bias, bias: [0.0, 0.0, 0.0]}}]"
    found = compare_response(scenario(spoof))
    assert [(str(one.link), one.step, one.reasons) for one in found.accused] == [("1-2", START, ("by_stream",))]


def test_nothing_to_compare_without_a_response(scenario: Callable[..., Scenario]) -> None:
    """A scenario whose DGUs do nothing about a verdict is refused in one line."""
    with pytest.raises(BagError, match=r"no monitor\.response"):
        compare_response(scenario("monitor.response=null"))
