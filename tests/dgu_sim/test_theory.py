"""What the theory page says about secondary control and attacks (section 2) and couplings (section 1)."""

from collections.abc import Callable

import numpy as np
import pytest

from dgu_sim.linear import FloatArray
from dgu_sim.scenario import Scenario
from dgu_sim.simulate import simulate


def _run(scenario: Scenario) -> FloatArray:
    """Return the states of all DGUs, shape (steps, DGUs, 3)."""
    (block,) = simulate(scenario, block_steps=scenario.steps)
    return block.x[:, 0]


def _bias(link: str, current: float) -> str:
    return f"{{kind: bias, link: {link}, start_sec: 5, bias: [0, {current}, 0]}}"


def test_current_bias_makes_the_mean_voltage_ramp(shipped: Callable[..., Scenario]) -> None:
    """d<V>/dt = k_I sum(phi_I) / N, within 1 %, for one link and for two."""
    for attacks, total in ((_bias("1-2", 0.5), 0.5), (_bias("1-2", 0.5) + "," + _bias("5-4", 0.2), 0.7)):
        scenario = shipped("gallo_six_dgu", "duration_sec=40", f"attacks=[{attacks}]")
        mean_voltage = _run(scenario)[:, :, 0].mean(axis=1)
        slope = (mean_voltage[3999] - mean_voltage[1999]) / 20.0
        assert slope == pytest.approx(0.1 * total / 6.0, rel=0.01)


def test_strong_control_ramps_as_published(shipped: Callable[..., Scenario]) -> None:
    """0.5 A on one link with k_I = 0.5 lifts the mean voltage by 0.49 V in 12 s and by 1.33 V in 32 s."""
    attack = "attacks=[{kind: bias, link: 1-2, start_sec: 3, bias: [0, 0.5, 0]}]"
    resistances = (0.5, 0.7, 1.0, 0.4, 0.6, 0.8, 0.8)
    weak = [f"lines.{line}.resistance_ohm={ohm}" for line, ohm in enumerate(resistances)]
    scenario = shipped("gallo_six_dgu", "duration_sec=36", "secondary.gain=0.5", attack, *weak)
    mean_voltage = _run(scenario)[:, :, 0].mean(axis=1)
    lift = mean_voltage - mean_voltage[299]
    assert lift[300 + 1200] == pytest.approx(0.49, abs=0.006)
    assert lift[300 + 3200] == pytest.approx(1.33, abs=0.006)


def test_zero_sum_attack_leaves_the_mean_alone_and_distorts_the_sharing(shipped: Callable[..., Scenario]) -> None:
    """Current biases that sum to zero bring the mean voltage back and the currents apart."""
    attacks = f"attacks=[{_bias('1-2', 0.5)},{_bias('5-4', -0.5)}]"
    x = _run(shipped("gallo_six_dgu", "duration_sec=60", attacks))
    clean = _run(shipped("gallo_six_dgu", "duration_sec=60", "attacks=[]"))
    assert abs(x[-1, :, 0].mean() - 48.0) < 1e-9
    assert np.ptp(clean[-1, :, 1]) < 1e-6
    assert np.ptp(x[-1, :, 1]) > 0.1


def test_consensus_shares_currents_in_proportion_and_keeps_the_mean(shipped: Callable[..., Scenario]) -> None:
    """Without attack I_i / I^r_i become equal and the mean voltage is the mean reference."""
    scenario = shipped("consensus_six_dgu", "attacks=[]", "duration_sec=60")
    x = _run(scenario)
    shares = x[-1, :, 1] / [dgu.rated_current_a for dgu in scenario.dgus]
    assert np.ptp(shares) < 1e-6 * shares.mean()
    assert x[-1, :, 0].mean() == pytest.approx(np.mean([dgu.reference_v for dgu in scenario.dgus]), abs=1e-9)


def test_held_coupling_is_a_first_order_splitting_of_the_joint_grid(shipped: Callable[..., Scenario]) -> None:
    """After a 5 A load step the voltage error is 0.25 V at most, 0.04 V after 0.1 s, below 1e-5 V at the end."""
    step = "dgus.0.load=[{kind: constant, current_a: 10}, {kind: step, current_a: 5, at_sec: 2}]"
    common = ("attacks=[]", "secondary.enabled=false", step)
    held, joint = (_run(shipped("gallo_six_dgu", *common, f"coupling={name}")) for name in ("held", "joint"))
    error = np.abs(held[:, :, 0] - joint[:, :, 0]).max(axis=1)
    assert error[:200].max() < 1e-9
    assert error.max() == pytest.approx(0.25, abs=0.01)
    assert error[210] == pytest.approx(0.04, abs=0.005)
    assert error[-1] < 1e-5
