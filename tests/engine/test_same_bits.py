"""Kernels and numpy: the same bits, whatever runs, in whatever shape."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dcmg.shipped import scenario_path
from dgu_sim.scenario import Scenario, parse_scenario
from dgu_sim.simulate import Block, Doubled, simulate
from engine import NUMPY, VARIABLE, EngineError, available, chosen

if TYPE_CHECKING:
    from collections.abc import Iterator

KERNELS = [engine for engine in available() if engine != NUMPY]
GALLO = scenario_path("gallo_six_dgu").read_text(encoding="utf-8")

LOADS = (
    "[{kind: constant, current_a: 8.0}, {kind: step, current_a: 3.0, at_sec: 0.4}]",
    "[{kind: uniform, low_a: 5.0, high_a: 12.0, hold_sec: 0.05}, {kind: gaussian, mean_a: 1.0, std_a: 0.2}]",
    "[{kind: ramp, current_a: 4.0, start_sec: 0.1, stop_sec: 0.9}, {kind: uniform, low_a: 0.0, high_a: 1.0}]",
    "[{kind: gaussian, mean_a: 9.0, std_a: 0.0, hold_sec: 3.3}]",
)
NOISES = (
    "{kind: none}",
    "{kind: uniform, half_width: [0.01, 0.02, 0.0]}",
    "{kind: gaussian, std: [0.01, 0.0, 0.001]}",
    "{kind: student, scale: [0.01, 0.01, 0.001]}",
)
ATTACKS = (
    "[]",
    "[{kind: bias, link: 1-2, start_sec: 0.3, stop_sec: 0.5, bias: [0.1, 0.2, 0.3]}]",
    "[{kind: drop, link: 4-3, start_sec: 1, probability: 0.5}, {kind: replay, link: 1-2, start_sec: 1, record_sec: 1}]",
    "[{kind: spoof, link: 3-4, start_sec: 0.6, falsify: {kind: bias, bias: [0.0, 1.0, 0.0]}}]",
)
shapes = st.tuples(st.integers(1, 23), st.integers(1, 700))


def _scenario(coupling: str, load: str, noise: str, attacks: str, *, control: bool, sent: str) -> Scenario:
    changes = [
        f"coupling={coupling}",
        f"noise={noise}",
        f"attacks={attacks}",
        f"dgus.1.load={load}",
        f"dgus.4.load={load}",
        f"secondary.enabled={str(control and coupling != 'isolated').lower()}",
        f"dgus.2.output={sent}",
        "dgus.3.initial_spread=[0.5, 0.5, 0.1]",
        "duration_sec=6.3",
    ]
    return parse_scenario(GALLO, overrides=changes)


def _blocks(scenario: Scenario, engine: str, seeds: range, block_steps: int) -> Iterator[Block]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(VARIABLE, engine)
        yield from simulate(scenario, seeds, block_steps)


def _bytes(record: Block | Doubled) -> dict[str, object]:
    found = {one.name: getattr(record, one.name) for one in fields(record)}
    if isinstance(record, Block):
        found["doubled"] = [_bytes(one) for one in record.doubled]
    return {name: (one.shape, one.tobytes()) if isinstance(one, np.ndarray) else one for name, one in found.items()}


@pytest.mark.skipif(not KERNELS, reason="no kernels were compiled")
@settings(max_examples=25)
@given(
    coupling=st.sampled_from(("isolated", "held", "joint")),
    load=st.sampled_from(LOADS),
    noise=st.sampled_from(NOISES),
    attacks=st.sampled_from(ATTACKS),
    control=st.booleans(),
    sent=st.sampled_from(("[V, I_t, v]", "[V, v]")),
    shape=shapes,
)
def test_every_engine_gives_the_bits_of_numpy(
    coupling: str, load: str, noise: str, attacks: str, *, control: bool, sent: str, shape: tuple[int, int]
) -> None:
    """Couplings, loads, noises, attacks, hidden outputs; any number of runs, in blocks of any length."""
    runs, block_steps = shape
    scenario = _scenario(coupling, load, noise, attacks, control=control, sent=sent)
    wanted = [_bytes(one) for one in _blocks(scenario, NUMPY, range(runs), block_steps)]
    for engine in KERNELS:
        assert [_bytes(one) for one in _blocks(scenario, engine, range(runs), block_steps)] == wanted, engine


@pytest.mark.skipif(not KERNELS, reason="no kernels were compiled")
@pytest.mark.parametrize("links", ["[]", "[{between: [1, 2], resistance_ohm: 0.05, inductance_h: 2.1e-6}]"])
def test_grids_without_neighbours_have_the_same_bits(links: str) -> None:
    """No line at all, and DGUs that hear nobody."""
    scenario = parse_scenario(GALLO, overrides=[f"lines={links}", "attacks=[]", "duration_sec=1.0"])
    wanted = [_bytes(one) for one in _blocks(scenario, NUMPY, range(3), 40)]
    for engine in KERNELS:
        assert [_bytes(one) for one in _blocks(scenario, engine, range(3), 40)] == wanted, engine


def test_an_engine_that_is_not_there_is_refused_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """Name, value and what is expected."""
    monkeypatch.setenv(VARIABLE, "abacus")
    with pytest.raises(EngineError, match=r"DCMG_ENGINE = 'abacus': expected an engine that runs here: .*numpy"):
        chosen()
