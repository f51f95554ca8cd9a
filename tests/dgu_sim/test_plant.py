"""The physics of one DGU under the three couplings."""

from collections.abc import Callable

import numpy as np
import pytest

from dgu_sim.matrices import continuous_joint, discretise
from dgu_sim.plant import Coupling, IsolatedPlant, physical_of, plant_of
from dgu_sim.records import Physical
from dgu_sim.scenario import Scenario
from dgu_sim.stability import sampled_grid


@pytest.mark.parametrize("coupling", list(Coupling))
def test_every_dgu_steps_like_the_grid_matrix(shipped: Callable[..., Scenario], coupling: Coupling) -> None:
    """Stepping each DGU by itself is one step of x+ = A x + E w of the whole grid."""
    grid = shipped("gallo_six_dgu").grid
    A, E = sampled_grid(grid, coupling, 0.01)
    rng = np.random.default_rng(1)
    x, w = rng.normal(0.0, 10.0, (6, 3)), rng.normal(0.0, 10.0, (6, 2))
    expected = (A @ x.ravel() + E @ w.ravel()).reshape(6, 3)
    state = {
        dgu: Physical(x=x[i].tolist(), load_current=float(w[i, 0]), reference=float(w[i, 1]))
        for i, dgu in enumerate(grid.dgus)
    }
    for i, dgu in enumerate(grid.dgus):
        felt = [state[other] for other in physical_of(grid, coupling, dgu)]
        own = state[dgu]
        got = plant_of(grid, coupling, 0.01, dgu).step(own.x, own.load_current, own.reference, felt)
        np.testing.assert_allclose(np.asarray(got), expected[i], rtol=1e-11, atol=1e-11)


def test_slots_follow_the_coupling(shipped: Callable[..., Scenario]) -> None:
    """Isolated DGUs feel nobody, held ones their neighbours, jointly integrated ones everyone."""
    grid = shipped("gallo_six_dgu").grid
    assert physical_of(grid, Coupling.ISOLATED, 2) == ()
    assert physical_of(grid, Coupling.HELD, 2) == (1, 4)
    assert physical_of(grid, Coupling.JOINT, 2) == (1, 3, 4, 5, 6)


def test_coefficients_of_one_dgu_are_python_floats(shipped: Callable[..., Scenario]) -> None:
    """A node steps on Python floats only: numpy scalars would be ten times slower."""
    plant = plant_of(shipped("isolated_dgu_1").grid, Coupling.ISOLATED, 0.01, 1)
    assert isinstance(plant, IsolatedPlant)
    assert all(type(value) is float for value in plant.step((1.0, 2.0, 3.0), 4.0, 5.0, ()))


def test_joint_matrices_come_from_one_exponential(shipped: Callable[..., Scenario]) -> None:
    """The joint coupling is the exact discretisation of the coupled A_c, T (18) for the whole grid."""
    grid = shipped("gallo_six_dgu").grid
    A, E = sampled_grid(grid, Coupling.JOINT, 0.01)
    expected_A, expected_E = discretise(*continuous_joint(grid), 0.01)
    assert np.array_equal(A, expected_A)
    assert np.array_equal(E, expected_E)
