"""The offline experiment."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from dgu_sim.experiment import run_experiments
from dgu_sim.linear import FloatArray
from dgu_sim.matrices import continuous, discretise
from dgu_sim.scenario import Scenario


def _stacked(x: FloatArray) -> FloatArray:
    """Return [X_p; X_f], scaled to unit rows."""
    stacked = np.vstack([x[:-1].T, x[1:].T])
    return np.asarray(stacked / np.linalg.norm(stacked, axis=1, keepdims=True))


def _parity(A: FloatArray, E: FloatArray, x: FloatArray) -> float:
    """Return the largest |q'(x+ - A x)| with q orthogonal to range E: 0 when some d explains every step."""
    q = np.linalg.svd(E)[0][:, 2]
    return float(np.abs((x[1:] - x[:-1] @ A.T) @ q).max())


@pytest.mark.parametrize("dgu", range(1, 7))
def test_held_experiment_is_that_of_the_dgu_on_its_lines(shipped: Callable[..., Scenario], dgu: int) -> None:
    """Every step is A x + E d with the line conductances inside A, for some d; the isolated A does not explain it."""
    scenario = shipped("gallo_six_dgu")
    (data,) = run_experiments(scenario, dgu)
    grid = scenario.grid
    on_lines = discretise(*continuous(grid.parameters[dgu], sum(grid.conductances(dgu).values())), 0.01)
    alone = discretise(*continuous(grid.parameters[dgu]), 0.01)
    assert _parity(*on_lines, data.x) < 1e-9  # against |x| up to 1e3
    assert _parity(*alone, data.x) > 1e-3
    assert np.linalg.matrix_rank(_stacked(data.x), tol=1e-10) == 5


def test_isolated_experiment_is_the_one_of_the_paper(shipped: Callable[..., Scenario]) -> None:
    """Coupling isolated: d = (I_L, V_ref) + U(-1, 1)^2 around the operating values, x(0) ~ U(-1, 1)^3, T = 20."""
    scenario = shipped("isolated_dgu_1", "history.experiments=50")
    A, E = discretise(*continuous(scenario.grid.parameters[1]), 0.01)
    for data in run_experiments(scenario, 1):
        assert data.x.shape == data.y.shape == (20, 3)
        assert data.u.shape == (20, 0)
        assert data.sampling_period_sec == 0.01
        assert np.abs(data.x[0]).max() <= 1.0
        d = np.linalg.lstsq(E, (data.x[1:] - data.x[:-1] @ A.T).T, rcond=None)[0]
        assert np.abs(d.T - [9.0, 47.0]).max() <= 1.0 + 1e-8
        assert np.linalg.matrix_rank(_stacked(data.x), tol=1e-10) == 5


@pytest.mark.parametrize("scenario_name", ["gallo_six_dgu", "isolated_dgu_1"])
def test_recorded_inputs_explain_the_states(shipped: Callable[..., Scenario], scenario_name: str) -> None:
    """x+ = A x + E d with the recorded d, and d follows from the load and the voltages that the DGU measures itself."""
    scenario = shipped(scenario_name)
    grid, held = scenario.grid, scenario_name == "gallo_six_dgu"
    (data,) = run_experiments(scenario, 1)
    conductances = list(grid.conductances(1).values()) if held else []
    A, E = discretise(*continuous(grid.parameters[1], sum(conductances)), scenario.sampling_period_sec)
    assert np.abs(data.x[1:] - data.x[:-1] @ A.T - data.d[:-1] @ E.T).max() < 1e-9  # against |x| up to 1e3
    assert data.w.shape == (20, 1 + len(conductances))
    assert np.abs(data.d[:, 0] - data.w @ [1.0, *(-one for one in conductances)]).max() < 1e-9


def test_joint_experiment_breaks_the_rank(shipped: Callable[..., Scenario]) -> None:
    """On the jointly integrated grid d varies within a sample: [X_p; X_f] has full rank 6, the blind trap."""
    scenario = shipped("gallo_six_dgu_joint", "history.plant=joint", "history.samples=200")
    (data,) = run_experiments(scenario, 1)
    assert np.linalg.matrix_rank(_stacked(data.x), tol=1e-10) == 6


def test_joint_grid_may_learn_from_held_experiments(shipped: Callable[..., Scenario]) -> None:
    """With history.plant own, a joint scenario records what a held one records."""
    held, joint = shipped("gallo_six_dgu"), shipped("gallo_six_dgu", "coupling=joint")
    assert np.array_equal(run_experiments(held, 2)[0].x, run_experiments(joint, 2)[0].x)


def test_experiments_are_reproducible_and_different(shipped: Callable[..., Scenario]) -> None:
    """One scenario and DGU give one record; another number, DGU or seed gives another."""
    scenario = shipped("gallo_six_dgu", "history.experiments=3")
    first, second, third = run_experiments(scenario, 2)
    assert np.array_equal(first.x, run_experiments(shipped("gallo_six_dgu"), 2)[0].x)
    others = [second, third, run_experiments(scenario, 3)[0], run_experiments(shipped("gallo_six_dgu", "seed=2"), 2)[0]]
    assert all(not np.array_equal(first.x, other.x) for other in others)


def test_noise_and_rounding_are_applied_to_the_record(shipped: Callable[..., Scenario]) -> None:
    """Y = x whatever is done to the record; noise has the stated deviation; float32 numbers are float32 numbers."""
    size = "history.samples=2000"
    clean = run_experiments(shipped("gallo_six_dgu", size), 1)[0]
    noisy = run_experiments(shipped("gallo_six_dgu", size, "history.noise_std=1e-3"), 1)[0]
    rounded = run_experiments(shipped("gallo_six_dgu", size, "history.precision=float32"), 1)[0]
    for data in (clean, noisy, rounded):
        assert np.array_equal(data.x, data.y)
    assert abs((noisy.x - clean.x).std() / 1e-3 - 1.0) < 5.0 / np.sqrt(2 * clean.x.size)
    assert np.array_equal(rounded.x, clean.x.astype(np.float32))
    assert np.linalg.matrix_rank(_stacked(rounded.x), tol=1e-10) == 6


def test_matrices_of_whole_numbers_are_sampled_as_others() -> None:
    """Whole numbers, Fortran's order, what was sampled before: the same matrices, and nobody's changes are others'."""
    A, E = np.array([[0, 1], [-2, -3]]), np.array([[0], [1]])
    wanted = discretise(A.astype(float), E.astype(float), 0.1)
    odd: list[tuple[Any, Any]] = [(A, E), (np.asfortranarray(A), np.asfortranarray(E, dtype=np.float32))]
    for A_c, E_c in odd:
        found = discretise(A_c, E_c, 0.1)
        for one, other in zip(found, wanted, strict=True):
            np.testing.assert_array_equal(one, other)
        found[0][:] = 0.0
