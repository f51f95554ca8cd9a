"""Parameters of a DGU and the gain condition."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from dgu_sim.matrices import continuous
from dgu_sim.parameters import DguParameters

DGU_1 = DguParameters(R_t=0.2, L_t=1.8e-3, C_t=2.2e-3, k1=-2.134, k2=-0.163, k3=13.553)


@given(
    st.builds(
        DguParameters,
        R_t=st.floats(0.05, 1.0),
        L_t=st.floats(1e-4, 1e-2),
        C_t=st.floats(1e-4, 1e-2),
        k1=st.floats(-9.0, 3.0),
        k2=st.floats(-1.0, 2.0),
        k3=st.floats(-50.0, 500.0),
    )
)
def test_gain_condition_decides_stability(parameters: DguParameters) -> None:
    """An isolated DGU is stable exactly when the gain condition holds."""
    A_c, _ = continuous(parameters)
    eigenvalues = np.linalg.eigvals(A_c)
    # Eigenvalues this close to the axis, against norms up to 1e5, are not decided in double precision.
    assume(np.abs(eigenvalues.real).min() > 1e-6 * np.abs(eigenvalues).max())
    assert (parameters.gain_violation() is None) == bool(eigenvalues.real.max() < 0.0)


@pytest.mark.parametrize(("gain", "value"), [("k1", 1.5), ("k2", 0.3), ("k3", -1.0), ("k3", 1e4)])
def test_violated_gain_is_named(gain: str, value: float) -> None:
    """The violating gain and its limit are named."""
    changed = {"k1": replace(DGU_1, k1=value), "k2": replace(DGU_1, k2=value), "k3": replace(DGU_1, k3=value)}
    violation = changed[gain].gain_violation()
    assert violation is not None
    assert violation[0] == gain
    assert "gain condition" in violation[1]
