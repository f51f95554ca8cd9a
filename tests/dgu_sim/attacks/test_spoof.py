"""A second publisher on a link: what it says, what the receivers make of it, what is refused."""

from collections.abc import Callable

import numpy as np
import pytest

from dgu_sim.errors import AttackError, ScenarioError
from dgu_sim.grid import Link
from dgu_sim.records import Sample
from dgu_sim.relay import Spoofing
from dgu_sim.scenario import Scenario
from dgu_sim.simulate import relay_of, simulate

SPOOF = "{kind: spoof, link: 1-2, start_sec: 3, stop_sec: 3.5, falsify: {kind: bias, bias: [0, 0.5, 0]}}"
RELAYED = "{kind: bias, link: 1-2, start_sec: 3, stop_sec: 3.5, bias: [0, 0.5, 0]}"


def test_the_newest_message_does_what_the_falsification_does(shipped: Callable[..., Scenario]) -> None:
    """A receiver that keeps the newest message is steered as if the link itself were falsified."""
    (spoofed,) = simulate(shipped("gallo_six_dgu", "duration_sec=4", f"attacks=[{SPOOF}]"))
    (relayed,) = simulate(shipped("gallo_six_dgu", "duration_sec=4", f"attacks=[{RELAYED}]"))
    assert np.array_equal(spoofed.x, relayed.x)
    assert np.array_equal(spoofed.received, relayed.received)
    assert [(one.step, one.position) for one in spoofed.doubled] == [(step, 3) for step in range(300, 350)]
    assert relayed.doubled == ()


def test_both_messages_are_kept_and_the_true_one_is_true(shipped: Callable[..., Scenario]) -> None:
    """The first message of a spoofed step is what the DGU sent, in every run."""
    scenario = shipped("gallo_six_dgu", "duration_sec=4", f"attacks=[{SPOOF}]")
    (block,) = simulate(scenario, seeds=(3, 4))
    for one in block.doubled:
        assert np.array_equal(one.relayed, block.y[one.step, :, 0])
        assert np.array_equal(one.spoofed, block.received[one.step, :, one.position])
        np.testing.assert_array_equal(one.spoofed, one.relayed + np.array([0.0, 0.5, 0.0]))
        assert one.relayed_delivered.all()


def test_who_knows_its_publisher_is_not_steered(shipped: Callable[..., Scenario]) -> None:
    """With receiver.accept known_publisher the messages are there, and nothing else changes."""
    known = "receiver.accept=known_publisher"
    (spoofed,) = simulate(shipped("gallo_six_dgu", "duration_sec=4", known, f"attacks=[{SPOOF}]"))
    (clean,) = simulate(shipped("gallo_six_dgu", "duration_sec=4", known, "attacks=[]"))
    assert np.array_equal(spoofed.x, clean.x)
    assert np.array_equal(spoofed.received, clean.received)
    assert len(spoofed.doubled) == 50


def test_other_attacks_on_the_link_leave_the_imposter_alone(shipped: Callable[..., Scenario]) -> None:
    """A later attack changes what the link delivers; the imposter goes on from what it heard before."""
    later = "{kind: bias, link: 1-2, start_sec: 3, stop_sec: 3.5, bias: [1, 0, 0]}"
    (block,) = simulate(shipped("gallo_six_dgu", "duration_sec=4", f"attacks=[{SPOOF}, {later}]"))
    one = block.doubled[0]
    sent = block.y[one.step, :, 0]
    np.testing.assert_array_equal(one.relayed, sent + np.array([1.0, 0.0, 0.0]))
    np.testing.assert_array_equal(one.spoofed, sent + np.array([0.0, 0.5, 0.0]))


@pytest.mark.parametrize(
    ("falsify", "said"),
    [
        ("{kind: spoof, falsify: {}}", "falsify.kind = 'spoof': expected what the messages say, one of bias"),
        ("{}", "falsify.kind = None: expected what the messages say"),
        ("{kind: bias}", "falsify.bias: this key is missing"),
        ("{kind: bias, bias: [1, 2]}", "falsify.bias = [1, 2]: expected 3 numbers"),
    ],
)
def test_wrong_falsifications_are_refused_in_one_line(
    shipped: Callable[..., Scenario], falsify: str, said: str
) -> None:
    """What a second publisher says is checked like any attack."""
    with pytest.raises(ScenarioError) as caught:
        shipped("gallo_six_dgu", f"attacks=[{{kind: spoof, link: 1-2, start_sec: 3, falsify: {falsify}}}]")
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_one_second_publisher_at_a_time(shipped: Callable[..., Scenario]) -> None:
    """A third publisher and one before the first true message are refused; one after the other is fine."""
    relay, state = relay_of(shipped("gallo_six_dgu", f"attacks=[{SPOOF}]"))
    assert relay.spoofings(state) == (Spoofing(link=Link(1, 2), first_step=300, end_step=350),)
    spoof: dict[str, object] = {"falsify": {"kind": "freeze"}}
    with pytest.raises(AttackError, match="expected step 1 or later"):
        relay.start(state, Link(3, 1), "spoof", spoof)
    state, _, _ = relay.step(state, [Sample(y=(48.0, 10.0, 3.0)) for _ in relay.dgus])
    with pytest.raises(AttackError, match="link 1-2: a second publisher speaks there already"):
        relay.start(state, Link(1, 2), "spoof", spoof)
    state, _ = relay.start(state, Link(1, 2), "spoof", {**spoof, "anyway": True}, duration_sec=1.0)
    assert [one.first_step for one in relay.spoofings(state)] == [300, 1]
