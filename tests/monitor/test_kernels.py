"""The same observers on processors with other BLAS kernels, up to rounding."""

from __future__ import annotations

from tests.kernels import others
from tests.monitor.kernel_figures import apart


def test_designs_of_exact_histories_differ_by_rounding_only() -> None:
    """Whatever the strategy, kernels of another processor change no entry by more than 1e-12."""
    table = apart(("", *others()[:1]))
    assert all(difference < 1e-12 for name, (difference, _, _) in table.items() if "noise" not in name), table
