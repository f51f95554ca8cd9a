"""Loads and noise from the kernels: numpy's own random numbers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dgu_sim.exogenous import DguExogenous, GridExogenous
from dgu_sim.loads import ConstantLoad, GaussianLoad, LoadModel, RampLoad, UniformLoad
from dgu_sim.noise import GaussianNoise, NoiseModel, UniformNoise
from dgu_sim.signals import BLOCK
from engine import NUMPY, VARIABLE, available

pytestmark = pytest.mark.skipif(available() == (NUMPY,), reason="no kernels were compiled")

GAUSSIAN = GaussianNoise(kind="gaussian", std=(1.0, 0.3, 1e-9))
UNIFORM = UniformNoise(kind="uniform", half_width=(0.7, 0.0, 3.0))
holds = st.one_of(st.none(), st.sampled_from((0.001, 0.01, 0.07, 2.55, 2.56, 2.57, 9.99)))
numbers = st.floats(-50.0, 50.0, allow_subnormal=False)
load_models = st.one_of(
    st.builds(ConstantLoad, kind=st.just("constant"), current_a=numbers),
    st.builds(RampLoad, kind=st.just("ramp"), current_a=numbers, start_sec=st.just(1.0), stop_sec=st.just(7.0)),
    st.builds(UniformLoad, kind=st.just("uniform"), low_a=numbers, high_a=st.floats(50.0, 60.0), hold_sec=holds),
    st.builds(GaussianLoad, kind=st.just("gaussian"), mean_a=numbers, std_a=st.floats(0.0, 9.0), hold_sec=holds),
)


def _signals(
    seeds: list[int], loads: list[list[LoadModel]], noise: NoiseModel | None, engine: str, steps: range
) -> list[bytes]:
    members = tuple(
        tuple(
            DguExogenous(
                seed=seed,
                dgu=3 * place + 1,
                loads=tuple(own),
                noise=noise,
                initial_state=(48.0, place, -0.0),
                initial_spread=(0.5, 0.0, 0.1),
                sampling_period_sec=0.01,
            )
            for place, own in enumerate(loads)
        )
        for seed in seeds
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(VARIABLE, engine)
        grid = GridExogenous(members=members)
        found = [np.asarray(grid.initial()).tobytes()]
        for step in steps:
            block = grid.block(step)
            found += [np.asarray(block.load).tobytes(), np.asarray(block.noise).tobytes()]
    return found


@settings(max_examples=25)
@given(
    seeds=st.lists(st.integers(0, 2**63), min_size=1, max_size=5),
    loads=st.lists(st.lists(load_models, max_size=3), min_size=1, max_size=5),
    noise=st.sampled_from((None, GAUSSIAN, UNIFORM)),
    block=st.integers(0, 40),
)
def test_signals_are_those_of_numpy(
    seeds: list[int], loads: list[list[LoadModel]], noise: NoiseModel | None, block: int
) -> None:
    """Seeds of one word and of two, several loads, values that are held across blocks, blocks far from the start."""
    steps = range(BLOCK * block + 7, BLOCK * (block + 2) + 7, BLOCK)
    assert _signals(seeds, loads, noise, available()[0], steps) == _signals(seeds, loads, noise, NUMPY, steps)


def test_a_million_normal_numbers_are_those_of_numpy() -> None:
    """All layers of the ziggurat, its edges and its tail."""
    seeds = list(range(300))
    loads: list[list[LoadModel]] = [[] for _ in range(6)]
    wanted = _signals(seeds, loads, GAUSSIAN, NUMPY, range(0, 1, BLOCK))
    assert _signals(seeds, loads, GAUSSIAN, available()[0], range(0, 1, BLOCK)) == wanted
    assert np.abs(np.frombuffer(wanted[2])).max() > 4.0  # beyond 3.65 is the tail
