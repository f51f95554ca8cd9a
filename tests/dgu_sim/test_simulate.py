"""The time loop."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from dgu_sim.relay import Action
from dgu_sim.scenario import Scenario
from dgu_sim.simulate import loop_of, simulate

SHORT = "duration_sec=3.0"
ATTACK = "attacks=[{kind: bias, link: 1-2, start_sec: 2.6, stop_sec: 2.8, bias: [0.1, 0.2, 0.3]}]"


def test_blocks_cover_every_step_once(shipped: Callable[..., Scenario]) -> None:
    """Blocks follow one another, the last one is shorter, and shapes are as documented."""
    blocks = list(simulate(shipped("gallo_six_dgu", SHORT, "attacks=[]"), seeds=[1, 2], block_steps=128))
    assert [block.first_step for block in blocks] == [0, 128, 256]
    assert [len(block.x) for block in blocks] == [128, 128, 44]
    block = blocks[0]
    assert block.x.shape == block.y.shape == (128, 2, 6, 3)
    assert block.load_current.shape == block.reference.shape == block.alpha.shape == (128, 2, 6)
    assert block.received.shape == (128, 2, 14, 3)
    assert block.delivered.shape == (128, 2, 14)
    assert block.delivered.all()
    assert all(array.flags.c_contiguous for array in (block.x, block.y, block.received, block.load_current))


def test_links_receive_what_their_source_sent_plus_the_attack(shipped: Callable[..., Scenario]) -> None:
    """y^c = y on every link and step, except on the attacked one during the attack: T (19)."""
    scenario = shipped("gallo_six_dgu", SHORT, ATTACK)
    (block,) = simulate(scenario)
    for position, link in enumerate(scenario.links):
        sent = block.y[:, 0, scenario.grid.dgus.index(link.source)]
        phi = np.zeros_like(sent)
        if str(link) == "1-2":
            phi[260:280] = [0.1, 0.2, 0.3]
        assert np.array_equal(block.received[:, 0, position], sent + phi)


def test_events_carry_their_run(shipped: Callable[..., Scenario]) -> None:
    """Every run reports the start and the stop, in the block they happen in."""
    blocks = list(simulate(shipped("gallo_six_dgu", SHORT, ATTACK), seeds=[4, 5], block_steps=270))
    found = [[(one.run, one.event.step, one.event.action) for one in block.events] for block in blocks]
    assert found[0] == [(0, 260, Action.START), (1, 260, Action.START)]
    assert found[1] == [(0, 280, Action.STOP), (1, 280, Action.STOP)]


def test_reference_is_v_ref_plus_alpha_and_outputs_are_noisy_states(shipped: Callable[..., Scenario]) -> None:
    """What is recorded fits together at every step."""
    scenario = shipped("consensus_six_dgu", "noise={kind: uniform, half_width: [0.1, 0.1, 0.0]}", "duration_sec=7.0")
    (block,) = simulate(scenario, block_steps=10_000)
    v_ref = np.array([dgu.reference_v for dgu in scenario.dgus])
    assert np.array_equal(block.reference, v_ref + block.alpha)
    noise = block.y - block.x
    assert np.abs(noise[..., :2]).max() <= 0.1 + 1e-13  # the sum x + noise is rounded
    assert noise[..., :2].std() > 0.05
    assert not noise[..., 2].any()
    assert np.array_equal(block.load_current[599] * 2.0, block.load_current[600])


def test_a_grid_of_one_dgu_without_lines_runs(shipped: Callable[..., Scenario]) -> None:
    """No line, no link, no neighbour: the arrays are empty there and the physics runs."""
    one = shipped("gallo_six_dgu", "lines=[]", "attacks=[]", "duration_sec=1.0")
    one = one.model_copy(update={"dgus": one.dgus[:1]})
    fresh = Scenario.model_validate(one.model_dump())
    (block,) = simulate(fresh)
    assert block.received.shape == (100, 1, 0, 3)
    np.testing.assert_allclose(block.x[-1], block.x[0], rtol=1e-9)


def test_a_state_goes_on_more_than_once(shipped: Callable[..., Scenario]) -> None:
    """From one state the same steps come out as often as it is asked, and an attack in one future leaves the other."""
    scenario = shipped("consensus_six_dgu", "noise={kind: uniform, half_width: [0.1, 0.1, 0.0]}", "attacks=[]")
    loop, state = loop_of(scenario)
    state, _ = loop.run(state, 70)
    attacked, _ = loop.relay.start(state.relay, scenario.links[0], "bias", {"bias": [0.0, 1.0, 0.0]})
    futures = [loop.run(one, 200)[1] for one in (state, replace(state, relay=attacked), state)]
    for name in ("x", "y", "received", "load_current", "alpha"):
        assert np.array_equal(getattr(futures[0], name), getattr(futures[2], name))
    assert not np.array_equal(futures[0].alpha, futures[1].alpha)
    (whole,) = simulate(scenario, block_steps=10_000)
    assert np.array_equal(whole.x[70:270], futures[0].x)
