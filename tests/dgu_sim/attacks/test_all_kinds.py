"""Every attack class in one run: the relay in floats, in one array run and in a batch; events; links."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from bags.watch.scenarios import parse_scenario
from dgu_sim.attacks import KINDS
from dgu_sim.errors import AttackError, ScenarioError
from dgu_sim.grid import Link
from dgu_sim.records import Sample
from dgu_sim.relay import Action
from dgu_sim.scenario import Scenario
from dgu_sim.simulate import Block, relay_of, simulate

EXAMPLES = {
    "bias": "link: 2-1, bias: [0.1, 0.1, 0.1]",
    "bias_ramp": "link: 3-1, rate: [0.1, 1, 0.1], rise_sec: 0.4",
    "bias_sine": "link: 6-1, amplitude: [0, 0.5, 0], period_sec: 0.3",
    "bias_pulse": "link: 1-2, bias: [0, 0.5, 0], period_sec: 0.3, width_sec: 0.1",
    "bias_random": "links: [4-2, 1-3], spread: [0.1, 0.5, 0.1], distribution: gaussian",
    "bias_waveform": "link: 6-5, time_sec: [0, 0.2], current_a: [0, 0.5], interpolation: linear, repeat: true",
    "scaling": "link: 4-3, gain: [1, 0.9, 1]",
    "freeze": "link: 2-4",
    "delay": "link: 3-4, samples: 5",
    "drop": "links: [2-1, 5-4], probability: 0.3",
    "replay": "link: 4-5, record_sec: 0.2",
    "zero_sum": "links: [6-5, 1-6], shares: [0.5, -0.5]",
    "uio_stealthy_plane": "link: 5-6, current_a: 0.5",
    "uio_stealthy_trajectory": "links: [3-1, 4-2], current_a: 0.5, rise_sec: 0.5",
    "luenberger_stealthy": "links: [1-2, 4-2], voltage_v: 0.1",
    "covert": "links: [5-6], load_a: 2",
    "spoof": "link: 6-1, falsify: {kind: scaling, gain: [1, 0.9, 1]}",
}
SHORT = (
    "duration_sec=4",
    "noise={kind: uniform, half_width: [0.01, 0.02, 0.003]}",
    "monitor.detector.options={settle_sec: 0.1, calibrate_sec: 0.1}",
    "dgus.1.rated_current_a=2",
)


@pytest.fixture(name="scenario", scope="module")
def _scenario(shipped: Callable[..., Scenario]) -> Scenario:
    attacks = ", ".join(f"{{kind: {kind}, start_sec: 0.5, {rest}}}" for kind, rest in EXAMPLES.items())
    return shipped("gallo_six_dgu", *SHORT, f"attacks=[{attacks}]")


def _received(scenario: Scenario, sent: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Relay sent outputs (steps, DGUs, 3) as the attacker's node does, in Python floats; take the newest of two."""
    relay, state = relay_of(scenario)
    y, delivered = [], []
    for row in sent.tolist():
        state, relayed, _ = relay.step(state, [Sample(y=tuple(one)) for one in row])
        samples = [dict(state.spoofed).get(position, sample) for position, sample in enumerate(relayed)]
        assert all(type(value) is float for sample in samples for value in sample.y)
        assert all(type(sample.delivered) is bool for sample in samples)
        y.append([sample.y for sample in samples])
        delivered.append([sample.delivered for sample in samples])
    return np.array(y, dtype=np.float64), np.array(delivered)


def _whole(scenario: Scenario, seeds: tuple[int, ...] | None = None, block_steps: int = 4000) -> list[Block]:
    return list(simulate(scenario, seeds, block_steps))


def test_examples_cover_every_kind() -> None:
    """A new attack class is in this test, or it fails here."""
    assert set(EXAMPLES) == set(KINDS)


def test_floats_one_run_and_a_batch_agree_bit_for_bit(scenario: Scenario) -> None:
    """With all attacks on: the node's floats, one run in arrays and three runs in short blocks are the same bits."""
    (alone,) = _whole(scenario)
    y, delivered = _received(scenario, alone.y[:, 0])
    assert np.array_equal(alone.received[:, 0], y, equal_nan=True)
    assert np.array_equal(alone.delivered[:, 0], delivered)
    assert not delivered.all()
    batch = _whole(scenario, (7, scenario.seed, 9), 37)
    together = np.concatenate([block.received for block in batch], axis=0)
    assert np.array_equal(together[:, 1], alone.received[:, 0], equal_nan=True)
    (other,) = _whole(scenario.model_copy(update={"seed": 9}))
    assert np.array_equal(together[:, 2], other.received[:, 0], equal_nan=True)
    assert np.isfinite(alone.x).all()


def test_a_lost_link_leaves_the_other_dgus_alone(shipped: Callable[..., Scenario]) -> None:
    """A NaN on the link that pads the empty slots of the stacked control reaches nobody, not even its receiver."""
    attack = "{kind: drop, link: 2-1, start_sec: 0.5, stop_sec: 2}"
    (lost,) = _whole(shipped("gallo_six_dgu", *SHORT, f"attacks=[{attack}]"))
    (clean,) = _whole(shipped("gallo_six_dgu", *SHORT, "attacks=[]"))
    position = next(p for p, link in enumerate(shipped("gallo_six_dgu").links) if link == Link(2, 1))
    assert position == 0  # what `simulate` fills empty slots with
    assert np.isnan(lost.received[50:200, 0, position]).all()
    assert not lost.delivered[50:200, 0, position].any()
    assert np.isfinite(lost.x).all()
    assert np.isfinite(lost.alpha).all()
    moved = (lost.alpha[51, 0] != clean.alpha[51, 0]).tolist()  # one step later only the receiver knows
    assert moved == [True, False, False, False, False, False]


def test_an_attack_on_several_links_tells_of_each(scenario: Scenario) -> None:
    """START and STOP events come for every link, with one number."""
    (block,) = _whole(scenario)
    events = [one.event for one in block.events if one.event.kind == "luenberger_stealthy"]
    assert [(str(event.link), event.step, event.action) for event in events] == [
        ("1-2", 50, Action.START),
        ("4-2", 50, Action.START),
    ]
    assert len({event.attack for event in events}) == 1


def test_a_service_starts_an_attack_on_several_links(scenario: Scenario) -> None:
    """`links` among the parameters names them, the addressed one first; the others are told of by the next step."""
    relay, _ = relay_of(scenario)
    outputs = [Sample(y=(48.0, 10.0, 3.0)) for _ in relay.dgus]
    parameters: dict[str, object] = {"links": ["2-4", "3-4"], "voltage_v": 0.1, "anyway": True}
    state, started = relay.start(relay.init(), Link(2, 4), "luenberger_stealthy", parameters)
    assert (str(started.link), started.parameters) == ("2-4", '{"voltage_v": 0.1}')
    assert relay.stop(state, Link(2, 4))[1] != ()
    state, samples, events = relay.step(state, outputs)
    assert [(str(event.link), event.action) for event in events] == [("3-4", Action.START)]
    changed = [str(link) for link, one in zip(relay.links, samples, strict=True) if one.y[0] != 48.0]
    assert changed == ["2-4", "3-4"]
    _, stopped = relay.stop(state, Link(3, 4))
    assert [str(event.link) for event in stopped] == ["2-4", "3-4"]


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"links": ["3-4", "2-4"], "voltage_v": 1}, "expected different links, 2-4 the first"),
        ({"links": ["2-4", "2-4"], "voltage_v": 1}, "expected different links, 2-4 the first"),
        ({"links": "2-4", "voltage_v": 1}, "expected a list of links"),
        ({"links": ["2-4", "5-6"], "voltage_v": 1}, "expected at least two links into one DGU, found 2-4, 5-6"),
        ({"links": ["2-4", "2-6"], "voltage_v": 1}, "link 2-6: expected a communication link"),
        ({"voltage_v": 1}, "expected at least two links into one DGU, found 2-4"),
    ],
)
def test_wrong_links_of_a_service_are_refused(scenario: Scenario, parameters: dict[str, object], said: str) -> None:
    """One line says what was expected; nothing is started."""
    relay, _ = relay_of(scenario)
    with pytest.raises(AttackError) as caught:
        relay.start(relay.init(), Link(2, 4), "luenberger_stealthy", parameters)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("attack", "said"),
    [
        ("start_sec: 3, kind: freeze", "attacks.0.link = None: expected either link or links, found no link"),
        ("start_sec: 3, kind: freeze, link: 1-2, links: [1-2]", "found link and links"),
        ("start_sec: 3, kind: freeze, links: [1-2, 1-5]", "attacks.0.links.1 = '1-5': expected a communication link"),
        ("start_sec: 3, kind: freeze, links: [1-2, 1-2]", "attacks.0.links.1 = '1-2': expected a link that does not"),
        ("start_sec: 3, kind: zero_sum, links: [1-2], shares: [1, -1]", "expected 2 links, one for each of the shares"),
        ("start_sec: 3, kind: zero_sum, links: [1-2, 2-1], shares: [1, -2]", "numbers that add up to 0"),
        ("start_sec: 3, kind: luenberger_stealthy, link: 1-2, voltage_v: 1", "expected at least two links into one"),
        ("start_sec: 3, kind: drop, link: 1-2, probability: 1.5", "attacks.0.probability = 1.5: expected"),
        ("start_sec: 3, kind: delay, link: 1-2, samples: 0", "attacks.0.samples = 0: expected"),
        ("start_sec: 3, kind: bias_pulse, link: 1-2, bias: [1, 1, 1], period_sec: 1, width_sec: 1", "width_sec = 1"),
        ("start_sec: 3, kind: covert, link: 1-2, load: 1", "attacks.0.load = 1: no such key: did you mean load_a?"),
    ],
)
def test_wrong_attacks_of_a_scenario_are_refused_in_one_line(
    shipped: Callable[..., Scenario], attack: str, said: str
) -> None:
    """Links and parameters are checked before anything runs."""
    with pytest.raises(ScenarioError) as caught:
        shipped("gallo_six_dgu", f"attacks=[{{{attack}}}]")
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_several_links_round_trip(scenario: Scenario) -> None:
    """The resolved scenario reads back the same, and names link or links, not both."""
    assert parse_scenario(scenario.to_yaml()) == scenario
    dumped = scenario.model_dump(mode="json")["attacks"]
    assert all(("link" in one) != ("links" in one) for one in dumped)


def test_history_too_short_to_hide_in_is_refused(shipped: Callable[..., Scenario]) -> None:
    """An attack that learns from data says how much it needs."""
    attack = "{kind: uio_stealthy_plane, link: 1-2, current_a: 1, start_sec: 3}"
    scenario = shipped("gallo_six_dgu", "history.samples=4", f"attacks=[{attack}]")
    with pytest.raises(AttackError, match="history of DGU 1 has 3 pairs of samples, expected at least 5"):
        relay_of(scenario)
