"""One DGU in Python floats against all DGUs, and many runs, in arrays: the same bits."""

import math
from collections.abc import Callable, Sequence

import numpy as np
import pytest

from dgu_sim import settings as settings_module
from dgu_sim.attacks import Attack, AttackContext
from dgu_sim.attacks import registry as registry_module
from dgu_sim.commands import AttackCommand
from dgu_sim.linear import FloatArray
from dgu_sim.obeying import obey
from dgu_sim.records import Physical, Sample
from dgu_sim.scenario import Scenario
from dgu_sim.simulate import Block, relay_of, simulate
from dgu_sim.unit import equilibrium, unit_of

SEEDS = (11, 12, 13, 1, 15, 16, 17)
NOISY = (
    "noise={kind: gaussian, std: [0.01, 0.02, 0.003]}",
    "duration_sec=6.0",
    "dgus.0.load=[{kind: uniform, low_a: 9, high_a: 11}, {kind: step, current_a: 5, at_sec: 3}]",
    "dgus.3.load=[{kind: gaussian, mean_a: 13, std_a: 2, hold_sec: 0.07}]",
    "dgus.4.initial_spread=[1, 2, 3]",
    (
        "attacks=[{kind: bias, link: 1-2, start_sec: 2.5, stop_sec: 4, bias: [0.1, 0.1, 0.1]},"
        " {kind: losing, link: 3-4, start_sec: 3}, {kind: bias, link: 5-6, start_sec: 4.01, bias: [0, 1, 0]}]"
    ),
    (
        "script=[{step: 100, command: load_set, dgu: 4, current_a: 9}, {step: 130, command: load_step, dgu: 1,"
        " current_a: 2}, {step: 255, command: load_ramp, dgu: 4, current_a: -3, ramp_sec: 0.11}, {step: 300, command:"
        " reference_set, dgu: 6, voltage_v: 47.3}, {step: 320, command: attack_start, kind: bias_random,"
        " links: [6-1], parameters: {spread: [0.1, 0.1, 0.1]}, start_sec: 3.4, duration_sec: 1}, {step: 380, command:"
        " attack_change, kind: scaling, links: [6-1], parameters: {gain: [1, 1.1, 1]}}]"
    ),
)


class Losing(Attack):
    """Loses every third sample: a stateful attack, defined nowhere but here."""

    def init(self, context: AttackContext) -> object:
        """Return the number of samples seen."""
        del context
        return 0

    def step(self, state: object, samples: Sequence[Sample]) -> tuple[object, tuple[Sample, ...]]:
        """Lose samples 0, 3, 6, ..."""
        assert isinstance(state, int)
        lost = tuple(Sample(y=(math.nan,) * 3, delivered=False) for _ in samples)
        return state + 1, tuple(samples) if state % 3 else lost


@pytest.fixture(autouse=True)
def _losing_is_a_kind(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry_module, "KINDS", {**registry_module.KINDS, "losing": Losing})
    monkeypatch.setattr(settings_module, "KINDS", {**registry_module.KINDS})


def _units(scenario: Scenario) -> dict[str, FloatArray]:
    """Run every DGU as a node does: Python floats, one step after another."""
    units = [unit_of(scenario, dgu) for dgu in scenario.grid.dgus]
    relay, relay_state = relay_of(scenario)
    states = [unit.init() for unit in units]
    rows: dict[str, list[object]] = {name: [] for name in ("x", "y", "load", "reference", "alpha", "received", "heard")}
    for step in range(scenario.steps):
        for command in scenario.orders.due(step):
            states = [unit.steer(state, command) for unit, state in zip(units, states, strict=True)]
            if isinstance(command, AttackCommand):
                relay_state, _, _ = obey(relay, relay_state, command)
        outputs = [unit.output(state) for unit, state in zip(units, states, strict=True)]
        relay_state, samples, _ = relay.step(relay_state, [Sample(y=output.y) for output in outputs])
        felt = {
            unit.dgu: Physical(x=output.x, load_current=output.load_current, reference=output.reference)
            for unit, output in zip(units, outputs, strict=True)
        }
        heard = {(link.target, link.source): sample for link, sample in zip(relay.links, samples, strict=True)}
        states = [
            unit.step(state, [felt[dgu] for dgu in unit.physical], [heard[unit.dgu, dgu] for dgu in unit.neighbours])
            for unit, state in zip(units, states, strict=True)
        ]
        assert all(type(value) is float for output in outputs for value in (*output.x, *output.y, output.alpha))
        rows["x"].append([output.x for output in outputs])
        rows["y"].append([output.y for output in outputs])
        rows["load"].append([output.load_current for output in outputs])
        rows["reference"].append([output.reference for output in outputs])
        rows["alpha"].append([output.alpha for output in outputs])
        rows["received"].append([sample.y for sample in samples])
        rows["heard"].append([sample.delivered for sample in samples])
    return {name: np.array(values, dtype=np.float64) for name, values in rows.items()}


def _joined(blocks: Sequence[Block], run: int) -> dict[str, FloatArray]:
    """Return one run of consecutive blocks."""
    fields = ("x", "y", "load_current", "reference", "alpha", "received", "delivered")
    names = ("x", "y", "load", "reference", "alpha", "received", "heard")
    return {
        name: np.concatenate([getattr(block, field)[:, run] for block in blocks]).astype(np.float64)
        for name, field in zip(names, fields, strict=True)
    }


def _assert_same_bits(first: dict[str, FloatArray], second: dict[str, FloatArray]) -> None:
    for name, values in first.items():
        assert values.shape == second[name].shape, name
        assert np.array_equal(values, second[name], equal_nan=True), name


@pytest.mark.parametrize("coupling", ["isolated", "held", "joint"])
def test_units_one_run_and_seven_runs_agree_bit_for_bit(shipped: Callable[..., Scenario], coupling: str) -> None:
    """With noise, random loads, lost samples, attacks, commands: nodes, simulate and a batch give the same numbers."""
    off = ["secondary.enabled=false"] if coupling == "isolated" else []
    scenario = shipped("gallo_six_dgu", *NOISY, f"coupling={coupling}", *off)
    nodes = _units(scenario)
    _assert_same_bits(nodes, _joined(list(simulate(scenario)), 0))
    batch = list(simulate(scenario, SEEDS, block_steps=137))
    _assert_same_bits(nodes, _joined(batch, SEEDS.index(scenario.seed)))
    other = scenario.model_copy(update={"seed": SEEDS[0]})
    _assert_same_bits(_units(other), _joined(batch, 0))
    assert not np.array_equal(batch[0].y[:, 0], batch[0].y[:, 1])
    assert 0.0 < nodes["heard"].mean() < 1.0


def test_secondary_control_hears_the_attack_and_the_physics_does_not(shipped: Callable[..., Scenario]) -> None:
    """A bias on a voltage goes nowhere; one on a current moves alpha of its receiver in the next step."""
    clean = _joined(list(simulate(shipped("gallo_six_dgu", "attacks=[]"))), 0)
    for bias, moves in (("[1, 0, 1]", False), ("[0, 1, 0]", True)):
        overrides = f"attacks=[{{kind: bias, link: 1-2, start_sec: 5, bias: {bias}}}]"
        attacked = _joined(list(simulate(shipped("gallo_six_dgu", overrides))), 0)
        assert np.array_equal(attacked["alpha"][:501], clean["alpha"][:501])
        assert np.array_equal(attacked["x"], clean["x"]) != moves
        assert (attacked["alpha"][501, 1] != clean["alpha"][501, 1]) == moves


def test_equilibrium_of_the_coupled_grid_is_at_rest(shipped: Callable[..., Scenario]) -> None:
    """Started at alpha = 0 with constant loads and no secondary control, nothing moves."""
    overrides = ("secondary.enabled=false", "attacks=[]", "dgus.2.reference_v=47.5")
    for coupling in ("held", "joint"):
        scenario = shipped("gallo_six_dgu", *overrides, f"coupling={coupling}")
        x = _joined(list(simulate(scenario)), 0)["x"]
        # Rounding of A (3e-14) times 48 V, gathered by the slowest mode over 1/(1 - 0.995) steps.
        np.testing.assert_allclose(x, np.broadcast_to(x[0], x.shape), rtol=0.0, atol=3e-10)
        assert equilibrium(scenario, 3)[0] == 47.5


def test_unit_knows_whom_it_hears_and_feels(shipped: Callable[..., Scenario]) -> None:
    """Neighbours come from the lines, physical partners from the coupling."""
    held, joint = shipped("gallo_six_dgu"), shipped("gallo_six_dgu_joint")
    assert unit_of(held, 4).neighbours == (2, 3, 5)
    assert unit_of(held, 4).physical == (2, 3, 5)
    assert unit_of(joint, 4).physical == (1, 2, 3, 5, 6)
