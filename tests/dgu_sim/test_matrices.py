"""State-space matrices, continuous and sampled."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dgu_sim.grid import Grid, Line
from dgu_sim.linear import FloatArray
from dgu_sim.matrices import continuous, continuous_joint, discretise
from dgu_sim.parameters import DguParameters

DGU_1 = DguParameters(R_t=0.2, L_t=1.8e-3, C_t=2.2e-3, k1=-2.134, k2=-0.163, k3=13.553)
DGU_2 = DguParameters(R_t=0.3, L_t=2.0e-3, C_t=1.9e-3, k1=-0.869, k2=-0.050, k3=48.285)


def test_oracle_of_dgu_1() -> None:
    """A and E of DGU 1 at 10 ms are the published ones (theory.md section 3), to their printed digits."""
    A, E = discretise(*continuous(DGU_1), 0.01)
    expected_A = [[-0.28837, 0.10333, 5.39842], [-0.40767, -0.33421, 1.71161], [-0.00055, -0.00072, 0.95996]]
    expected_E = [[-0.24792, 0.04004], [1.28837, 0.01188], [0.00179, 0.0098]]
    np.testing.assert_allclose(A, expected_A, atol=6e-6)
    np.testing.assert_allclose(E, expected_E, atol=6e-6)


@given(st.floats(1e-4, 0.02), st.floats(0.0, 50.0))
def test_two_samples_are_one_of_twice_the_length(sampling_period_sec: float, conductance_s: float) -> None:
    """A(2T) = A(T)^2 and E(2T) = (A(T) + I) E(T): the discretisation is exact."""
    A_c, E_c = continuous(DGU_1, conductance_s)
    A, E = discretise(A_c, E_c, sampling_period_sec)
    A_2, E_2 = discretise(A_c, E_c, 2.0 * sampling_period_sec)
    np.testing.assert_allclose(A_2, A @ A, rtol=1e-10, atol=1e-10)  # entries reach 1e2
    np.testing.assert_allclose(E_2, (A + np.eye(3)) @ E, rtol=1e-10, atol=1e-10)


def test_rest_stays_at_rest() -> None:
    """X = [V_ref, I_L, v] with (k1-1)V + (k2-R_t)I + k3 v = 0 is a fixed point of the sampled DGU."""
    V_ref, I_L = 48.0, 10.0
    v = -((DGU_1.k1 - 1.0) * V_ref + (DGU_1.k2 - DGU_1.R_t) * I_L) / DGU_1.k3
    A, E = discretise(*continuous(DGU_1), 0.01)
    x = np.array([V_ref, I_L, v])
    np.testing.assert_allclose(A @ x + E @ [I_L, V_ref], x, rtol=1e-12)


@pytest.fixture(name="pair")
def _pair() -> Grid:
    return Grid(dgus=(1, 2), parameters={1: DGU_1, 2: DGU_2}, lines=(Line(between=(1, 2), resistance_ohm=0.05),))


def test_joint_grid_without_lines_is_block_diagonal(pair: Grid) -> None:
    """Without lines the joint matrices are those of each DGU."""
    A_c, E_c = continuous_joint(Grid(dgus=pair.dgus, parameters=pair.parameters, lines=()))
    for i, parameters in enumerate((DGU_1, DGU_2)):
        own_A, own_E = continuous(parameters)
        assert np.array_equal(A_c[3 * i : 3 * i + 3, 3 * i : 3 * i + 3], own_A)
        assert np.array_equal(E_c[3 * i : 3 * i + 3, 2 * i : 2 * i + 2], own_E)
    assert not A_c[:3, 3:].any()
    assert not A_c[3:, :3].any()


def _with_line_dynamics(pair: Grid, inductance_h: float) -> tuple[FloatArray, FloatArray]:
    """Return the joint grid with the line current as a seventh state: L i' = V_1 - V_2 - R i."""
    A_c, E_c = continuous_joint(Grid(dgus=pair.dgus, parameters=pair.parameters, lines=()))
    resistance = pair.lines[0].resistance_ohm
    full = np.zeros((7, 7))
    full[:6, :6] = A_c
    full[0, 6], full[3, 6] = -1.0 / DGU_1.C_t, 1.0 / DGU_2.C_t
    full[6, 0], full[6, 3], full[6, 6] = 1.0 / inductance_h, -1.0 / inductance_h, -resistance / inductance_h
    return full, np.vstack([E_c, np.zeros((1, 4))])


def test_quasi_stationary_lines_are_a_good_model(pair: Grid) -> None:
    """Leaving out the inductance of a published line moves the voltages after a 5 A step by less than 0.1 %."""
    A, E = discretise(*continuous_joint(pair), 0.01)
    A_full, E_full = discretise(*_with_line_dynamics(pair, 2.1e-6), 0.01)
    w = np.array([5.0, 0.0, 0.0, 0.0])
    x, x_full, largest, error = np.zeros(6), np.zeros(7), 0.0, 0.0
    for _ in range(100):
        x, x_full = A @ x + E @ w, A_full @ x_full + E_full @ w
        largest = max(largest, abs(x_full[0]), abs(x_full[3]))
        error = max(error, abs(x[0] - x_full[0]), abs(x[3] - x_full[3]))
    assert error < 1e-3 * largest
