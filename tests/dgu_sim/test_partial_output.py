"""DGUs that send only part of their output."""

from collections.abc import Callable

import numpy as np
import pytest

from dgu_sim.errors import ScenarioError
from dgu_sim.experiment import run_experiments
from dgu_sim.scenario import Scenario
from dgu_sim.simulate import simulate
from dgu_sim.unit import unit_of

Shipped = Callable[..., Scenario]


def test_what_is_not_sent_arrives_as_nan_and_changes_no_state(shipped: Shipped) -> None:
    """DGU 3 keeps v to itself: NaN on its links, in its history and nowhere else; the grid runs as ever."""
    partial = next(simulate(shipped("gallo_six_dgu_partial", "duration_sec=3.0", "attacks=[]")))
    whole = next(simulate(shipped("gallo_six_dgu", "duration_sec=3.0", "attacks=[]")))
    np.testing.assert_array_equal(partial.x, whole.x)
    hidden = np.isnan(partial.y)
    assert hidden[:, :, 2, 2].all()
    assert hidden.sum() == hidden[:, :, 2, 2].size
    (record,) = run_experiments(shipped("gallo_six_dgu_partial"), 3)
    assert np.isnan(record.y).all(axis=0).tolist() == [False, False, True]
    assert np.isfinite(record.x).all()


def test_one_dgu_in_floats_sends_the_bits_of_all_in_arrays(shipped: Shipped) -> None:
    """A node's floats and the simulation's arrays agree on what is sent, NaN included."""
    scenario = shipped("gallo_six_dgu_partial", "duration_sec=3.0", "attacks=[]")
    block = next(simulate(scenario))
    for position, dgu in enumerate(scenario.grid.dgus):
        unit = unit_of(scenario, dgu)
        np.testing.assert_array_equal(np.array(unit.output(unit.init()).y), block.y[0, 0, position])


@pytest.mark.parametrize("output", ["[]", "[V, V]", "[V, power]"])
def test_impossible_outputs_are_refused_in_one_line(shipped: Shipped, output: str) -> None:
    """No component, one twice, one that does not exist."""
    with pytest.raises(ScenarioError, match=r"dgus\.2\.output") as caught:
        shipped("gallo_six_dgu", f"dgus.2.output={output}")
    assert "\n" not in str(caught.value)
