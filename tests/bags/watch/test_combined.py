"""All tests of a DGU's monitor together: what hides from one is seen by another, and a response keeps the grid calm."""

from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

from bags.runs.offline import simulate_to_bag
from bags.runs.reader import read_run
from bags.runs.replay import replay, replay_windows
from bags.runs.run_record import RunRecord
from bags.watch.combined_arrays import CombinedArrays
from bags.watch.designs import design_scenario
from bags.watch.scenarios import load_scenario
from bags.watch.watcher import Watcher
from bags.wire.schema import topics_of
from dgu_sim.errors import ScenarioError
from dgu_sim.grid import Link
from dgu_sim.scenario import Scenario
from dgu_sim.simulate import Block, simulate

SCENARIOS = Path(__file__).parents[3] / "dcmg" / "scenarios"
START = 300  # step at which the attacks start
# equal loads: secondary control has nothing to do, so a few seconds are enough to learn from
CALM = tuple(f"dgus.{number}.load=[{{kind: constant, current_a: 12.0}}]" for number in range(6))
ALL = (
    "monitor.local={}",
    "monitor.plausibility={limits: {range: [0.4, 0.1]}}",
    "monitor.response={quiet_sec: 1.0}",
)


def _scenario(*overrides: str) -> Scenario:
    return load_scenario(SCENARIOS / "gallo_six_dgu.yaml", ("duration_sec=6", *CALM, *ALL, *overrides))


def _attack(attack: str) -> str:
    return f"attacks=[{{start_sec: {START * 0.01}, {attack}}}]"


def _run(scenario: Scenario, *, respond: bool = True) -> tuple[Block, CombinedArrays]:
    """One run with its monitors."""
    topics = topics_of(scenario)
    watch = Watcher(designs=design_scenario(scenario))
    (block,) = simulate(scenario, block_steps=scenario.steps, respond=watch if respond else None)
    said = watch.take()
    if not respond:
        seen = SimpleNamespace(
            y=block.y[:, 0],
            reference=block.reference[:, 0],
            received=block.received[:, 0],
            u=None,
            delivered=block.delivered[:, 0],
        )
        said = watch.follow(seen, {})
    assert said.combined is not None
    assert topics.combined is not None
    return block, said.combined.arrays(topics.combined)


def _named(scenario: Scenario, flags: NDArray[np.bool_]) -> set[str]:
    """Links with a flag at any step."""
    return {str(link) for link, flag in zip(scenario.links, np.any(flags, axis=0), strict=True) if flag}


def _excursion(block: Block) -> float:
    """Largest change of any bus voltage from the start of the attack on [V]."""
    V = block.x[:, 0, :, 0]
    return float(np.abs(V[START:] - V[START - 1]).max())


HIDDEN = {  # attack: links that lie, tests that name them
    "kind: uio_stealthy_trajectory, link: 1-2, voltage_v: 0.1, current_a: 0.5": ({"1-2"}, {"by_plausibility"}),
    "kind: uio_stealthy_trajectory, link: 1-2, current_a: 0.5": ({"1-2"}, {"by_plausibility"}),
    "kind: uio_stealthy_trajectory, links: [2-4, 3-4], voltage_v: 0.1": ({"2-4", "3-4"}, {"by_plausibility"}),
    "kind: uio_stealthy_plane, link: 1-2, voltage_v: 0.1, current_a: 0.5": (
        {"1-2"},
        {"by_residual", "by_plausibility"},
    ),
    "kind: luenberger_stealthy, links: [2-4, 3-4], voltage_v: 0.5": (
        {"2-4", "3-4"},
        {"by_residual", "by_plausibility"},
    ),
    "kind: covert, link: 1-2, load_a: 2": ({"1-2"}, {"by_plausibility"}),
}


@pytest.mark.parametrize("attack", HIDDEN)
def test_what_hides_from_one_test_is_named_by_another(attack: str) -> None:
    """Each attack that evades the observers, or the own state's, is seen, and exactly the links that lie are named."""
    links, tests = HIDDEN[attack]
    scenario = _scenario(_attack(attack))
    block, said = _run(scenario)
    assert not said.verdict.accused[:START].any()
    assert _named(scenario, said.verdict.accused) == links
    kinds = {name for name in ("by_residual", "by_plausibility") if getattr(said.verdict, name).any()}
    assert kinds == tests
    assert _excursion(block) < 0.01  # 0.5 A falsified would move the buses by 25 mV in these 3 s, and on without end


@pytest.mark.parametrize("estimator", ["op_uie", "cl_uie", "delayed"])
def test_any_estimator_feeds_the_plausibility_test(estimator: str, tmp_path: Path) -> None:
    """Inputs reconstructed from outputs alone, or with a delay, name the hidden attack too, in run and replay."""
    scenario = _scenario(
        _attack("kind: uio_stealthy_trajectory, link: 1-2, voltage_v: 0.1, current_a: 0.5"),
        f"monitor.plausibility.estimator={{kind: {estimator}}}",
        "history.samples=60",
        "duration_sec=4",
    )
    record = read_run(simulate_to_bag(scenario, tmp_path / "bag"))
    assert record.combined is not None
    assert record.combined.inputs is not None
    accused = record.combined.verdict.accused
    assert not accused[:START].any()
    assert _named(scenario, accused) == {"1-2"}
    again = replay(record).combined
    assert again is not None
    assert again.inputs is not None
    np.testing.assert_array_equal(again.inputs.input, record.combined.inputs.input)
    np.testing.assert_array_equal(again.verdict.accused, accused)


def test_the_response_keeps_the_grid_where_it_was() -> None:
    """Left out within 1 s, the falsified current moves no bus by more than a third of what it does unhindered."""
    scenario = _scenario(_attack("kind: uio_stealthy_trajectory, link: 1-2, current_a: 0.5"))
    with_response, said = _run(scenario)
    without, _ = _run(scenario, respond=False)
    assert _excursion(with_response) < _excursion(without) / 3.0
    position = scenario.links.index(Link(1, 2))
    first = int(np.flatnonzero(said.verdict.accused[:, position])[0])
    assert START < first < START + 100
    np.testing.assert_array_equal(said.verdict.dropped[:, position], np.arange(scenario.steps) >= first)
    np.testing.assert_array_equal(with_response.x[: first + 1], without.x[: first + 1])


def test_a_false_voltage_is_seen_by_the_own_state_at_once() -> None:
    """A trajectory that no observer sees stands in DGU 2's own residual from its first sample on; it names none."""
    scenario = _scenario(_attack("kind: uio_stealthy_trajectory, link: 1-2, voltage_v: 0.1"))
    _, said = _run(scenario)
    second = 1  # position of DGU 2
    assert int(np.flatnonzero(said.verdict.local[:, second])[0]) == START + 1
    assert not np.delete(said.verdict.local, second, axis=1).any()
    assert _named(scenario, said.verdict.suspected) == {"1-2", "4-2"}


def test_a_replayed_steady_state_is_seen_when_the_grid_moves() -> None:
    """Yesterday's voltage of DGU 5 explains nothing at DGU 4 any more once the load of DGU 5 steps.

    DGU 5's own module wonders about its load either way: it knows no range of it here.
    """
    step = "dgus.4.load=[{kind: constant, current_a: 12.0}, {kind: step, at_sec: 4.5, current_a: 5.0}]"
    wide = "monitor.plausibility={limits: {range: [20.0, 1.0]}}"  # a load may step by 5 A
    alarmed = {}
    for attack in (_attack("kind: replay, link: 5-4, record_sec: 0.5"), "attacks=[]"):
        scenario = _scenario(step, wide, attack, "duration_sec=5")
        _, said = _run(scenario)
        assert not said.verdict.accused.any()
        alarmed[attack] = set((np.flatnonzero(said.verdict.local.any(axis=0)) + 1).tolist())
    assert list(alarmed.values()) == [{4, 5}, {5}]


def test_what_a_small_enough_lie_can_do() -> None:
    """0.3 A, within the allowed 0.4 A, is not seen itself; others notice what it does before the mean moves 10 mV.

    Unhindered it moves the mean at k_I phi_I / N (theory, section 2) without end.
    """
    attack = _attack("kind: uio_stealthy_trajectory, link: 1-2, current_a: 0.3, rise_sec: 0.5")
    scenario = _scenario(attack, "secondary.gain=0.2", "duration_sec=14")
    block, said = _run(scenario, respond=False)
    first = int(np.flatnonzero(said.verdict.accused.any(axis=1))[0])
    mean_voltage = block.x[:, 0, :, 0].mean(axis=1)
    assert mean_voltage[1300] - mean_voltage[900] == pytest.approx(4.0 * 0.2 * 0.3 / 6.0, rel=0.01)
    assert not said.verdict.accused[first, scenario.links.index(Link(1, 2))]
    assert first > START + 50
    assert mean_voltage[first] - mean_voltage[START] < 0.01


@pytest.fixture(name="recorded", scope="module")
def _recorded(tmp_path_factory: pytest.TempPathFactory) -> RunRecord:
    attack = "attacks=[{kind: bias, link: 1-2, start_sec: 3, stop_sec: 3.5, bias: [0.1, 0.5, 0.0]}, \
        {kind: drop, link: 3-4, start_sec: 3.2, stop_sec: 3.4}]"
    scenario = _scenario(attack, "noise={kind: gaussian, std: [1.0e-4, 1.0e-4, 1.0e-5]}")
    return read_run(simulate_to_bag(scenario, tmp_path_factory.mktemp("combined") / "run"))


def test_a_bag_says_all_of_it(recorded: RunRecord) -> None:
    """Verdicts, own residuals, inputs and designs come back from the bag; links are heard again after quiet time."""
    said = recorded.combined
    assert said is not None
    assert said.local is not None
    assert said.inputs is not None
    position = recorded.links.index(Link(1, 2))
    assert said.verdict.by_residual[300:350, position].all()
    assert said.verdict.dropped[300:400, position].all()
    assert not said.verdict.dropped[-1].any()
    assert {alarm.monitor for alarm in recorded.alarms if alarm.source == alarm.monitor} == {2}
    assert {int(lag) for lag in said.inputs.lag.ravel()} == {1}
    shift = 5  # samples that what the observer's start leaves needs to die out
    d = said.inputs.input[shift + 1 : 300, position, 1]
    assert d == pytest.approx(recorded.reference[shift:299, 0], abs=0.2)  # noise of 1e-5 V s on v, 100 times amplified
    assert set(recorded.input_designs) == set(recorded.links)
    assert {Link(dgu, dgu) for dgu in recorded.topics.dgus} < set(recorded.designs)


def test_replay_repeats_all_of_it(recorded: RunRecord) -> None:
    """Fresh monitors on the recorded samples conclude the same, bit for bit, at once or window by window."""
    again = replay(recorded)
    assert again.combined is not None
    assert recorded.combined is not None
    for part in ("verdict", "local", "inputs"):
        one, other = getattr(recorded.combined, part), getattr(again.combined, part)
        for field in fields(one):
            np.testing.assert_array_equal(getattr(one, field.name), getattr(other, field.name))
    assert (again.alarms, again.designs, again.input_designs) == (
        recorded.alarms,
        recorded.designs,
        recorded.input_designs,
    )
    windows = list(replay_windows([recorded]))
    assert windows[-1].combined is not None


def test_replay_can_switch_tests_on_and_off(recorded: RunRecord) -> None:
    """A bag is enough to try other tests on it, or none."""
    plain = replay(recorded, ["monitor.local=null", "monitor.plausibility=null", "monitor.response=null"])
    assert plain.combined is None
    np.testing.assert_array_equal(plain.residual, recorded.residual)
    fewer = replay(recorded, ["monitor.local=null"])
    assert fewer.combined is not None
    assert fewer.combined.local is None
    assert fewer.combined.inputs is not None


def test_runs_side_by_side_are_each_run_alone() -> None:
    """A response in a batch of runs gives each run the bits that it has alone."""
    noise = "noise={kind: gaussian, std: [1.0e-4, 1.0e-4, 1.0e-5]}"
    scenario = _scenario(noise, "duration_sec=3.2", _attack("kind: bias, link: 1-2, bias: [0.0, 2.0, 0.0]"))
    designs = design_scenario(scenario)
    seeds = (4, 5)
    (together,) = simulate(scenario, seeds, scenario.steps, respond=Watcher(designs=designs, runs=2))
    for run, seed in enumerate(seeds):
        (alone,) = simulate(scenario, (seed,), scenario.steps, respond=Watcher(designs=designs))
        np.testing.assert_array_equal(together.x[:, run], alone.x[:, 0])


def test_a_response_needs_secondary_control() -> None:
    """Nothing can be left out of a control that is off."""
    with pytest.raises(ScenarioError, match=r"monitor\.response"):
        _scenario("secondary.enabled=false", "attacks=[]")


@pytest.fixture(name="bag_of", scope="module")
def _bag_of(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., RunRecord]:
    def run(*overrides: str) -> RunRecord:
        path = tmp_path_factory.mktemp("bags") / "run"
        return read_run(simulate_to_bag(_scenario("duration_sec=0.3", "attacks=[]", *overrides), path))

    return run


@pytest.mark.parametrize("off", ["local", "plausibility", "response"])
def test_each_part_works_without_the_others(bag_of: Callable[..., RunRecord], off: str) -> None:
    """The bag holds the topics of the parts that are on, and the reader finds out which."""
    record = bag_of(f"monitor.{off}=null")
    assert record.combined is not None
    assert (record.combined.local is None) == (off == "local")
    assert (record.combined.inputs is None) == (off == "plausibility")
    assert record.steps == 30
