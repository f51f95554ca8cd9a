"""Load currents."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from dgu_sim.loads import ConstantLoad, GaussianLoad, LoadModel, RampLoad, StepLoad, TableLoad, UniformLoad
from dgu_sim.signals import RandomSource

T_S = 0.01
SOURCE = RandomSource(seed=3, stream=1000, dgu=1)
LOADS: list[LoadModel] = [
    ConstantLoad(kind="constant", current_a=2.0),
    StepLoad(kind="step", current_a=5.0, at_sec=0.2),
    RampLoad(kind="ramp", current_a=4.0, start_sec=0.1, stop_sec=0.3),
    UniformLoad(kind="uniform", low_a=1.0, high_a=3.0, hold_sec=0.05),
    GaussianLoad(kind="gaussian", mean_a=1.0, std_a=0.5),
    TableLoad(kind="table", time_sec=(0.0, 0.1, 0.25), current_a=(1.0, -2.0, 3.0)),
]


@given(st.sampled_from(LOADS), st.integers(0, 700), st.integers(1, 300))
def test_a_load_is_a_function_of_the_step(load: LoadModel, first: int, count: int) -> None:
    """Whatever stretch is asked for, a step has one current."""
    whole = load.current(0, 1000, T_S, SOURCE)
    assert np.array_equal(load.current(first, count, T_S, SOURCE), whole[first : first + count])


def test_step_begins_at_its_sample() -> None:
    """The first sample at or after at_sec has the current, the one before has not."""
    current = LOADS[1].current(0, 40, T_S, SOURCE)
    assert current[19] == 0.0
    assert current[20] == 5.0
    assert LOADS[1].nominal() == 0.0


def test_ramp_is_linear_and_stays() -> None:
    """Half way it is at half height; after its end it stays."""
    current = LOADS[2].current(0, 100, T_S, SOURCE)
    assert current[10] == 0.0
    assert current[20] == pytest.approx(2.0, rel=1e-12)
    assert current[30:] == pytest.approx(4.0, rel=1e-12)


def test_table_holds_until_its_next_row() -> None:
    """Each value holds from its time until the next."""
    current = LOADS[5].current(0, 40, T_S, SOURCE)
    assert current[[0, 9, 10, 24, 25, 39]].tolist() == [1.0, 1.0, -2.0, -2.0, 3.0, 3.0]


def test_random_load_holds_its_value() -> None:
    """With hold_sec of five samples, five samples share a value and the next five another."""
    current = LOADS[3].current(0, 1000, T_S, SOURCE).reshape(-1, 5)
    assert (current == current[:, :1]).all()
    assert len(np.unique(current[:, 0])) == 200


def test_random_loads_have_the_stated_distribution() -> None:
    """Mean and spread of 20000 samples are within five standard errors of what was asked for."""
    uniform = UniformLoad(kind="uniform", low_a=1.0, high_a=3.0).current(0, 20000, T_S, SOURCE)
    gaussian = LOADS[4].current(0, 20000, T_S, SOURCE)
    assert uniform.min() >= 1.0
    assert uniform.max() < 3.0
    assert abs(uniform.mean() - 2.0) < 5.0 * (2.0 / np.sqrt(12.0)) / np.sqrt(20000)
    assert abs(gaussian.mean() - 1.0) < 5.0 * 0.5 / np.sqrt(20000)
    assert abs(gaussian.std() - 0.5) < 5.0 * 0.5 / np.sqrt(40000)


def test_nominal_is_the_operating_value() -> None:
    """The operating value is the mean at t = 0."""
    assert [load.nominal() for load in LOADS] == [2.0, 0.0, 0.0, 2.0, 1.0, 1.0]
    assert StepLoad(kind="step", current_a=5.0, at_sec=0.0).nominal() == 5.0


def test_reversed_ranges_are_refused() -> None:
    """A ramp that ends before it starts and a range upside down are errors."""
    with pytest.raises(ValidationError, match="after start_sec"):
        RampLoad(kind="ramp", current_a=4.0, start_sec=0.3, stop_sec=0.1)
    with pytest.raises(ValidationError, match="at least low_a"):
        UniformLoad(kind="uniform", low_a=3.0, high_a=1.0)
