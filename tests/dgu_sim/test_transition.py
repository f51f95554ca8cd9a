"""One pair of DGUs in floats, all of them in arrays."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from dgu_sim.linear import FloatArray
from dgu_sim.transition import PairTransition, stack_transitions

NUMBER = st.floats(-1e3, 1e3)


@settings(max_examples=50)
@given(
    st.integers(1, 4).flatmap(
        lambda dgus: st.tuples(
            npst.arrays(np.float64, (dgus, 3, 5), elements=NUMBER),
            npst.arrays(np.float64, (5, 2, dgus), elements=NUMBER),
        )
    )
)
def test_arrays_give_the_bits_of_floats(case: tuple[FloatArray, FloatArray]) -> None:
    """A x + E d of all DGUs and runs at once equals that of each DGU in Python floats, bit for bit."""
    matrices, z = case
    pairs = [PairTransition(rows=tuple((a, b, c, d, e) for a, b, c, d, e in M.tolist())) for M in matrices]
    together = np.asarray(stack_transitions(pairs).apply(z[:3], z[3], z[4]))
    for dgu, pair in enumerate(pairs):
        for run in range(2):
            V, I_t, v, current, reference = z[:, run, dgu].tolist()
            assert list(pair.apply((V, I_t, v), current, reference)) == together[:, run, dgu].tolist()
    # Only to rounding: a BLAS product sums in its own order.
    np.testing.assert_allclose(together, np.einsum("dij,jrd->ird", matrices, z), rtol=1e-9, atol=1e-6)
