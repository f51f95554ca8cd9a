"""The comparison of methods for noisy histories, at a small size; docs/noise.md holds the whole one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dcmg.papers import noise_methods

if TYPE_CHECKING:
    from pathlib import Path


def test_structured_leads_on_long_histories(tmp_path: Path) -> None:
    """With noise 1e-2 and 400 samples the default method sees smaller biases than plain truncation and regression."""
    result = noise_methods.run(0, trials=1, noise_std=(1e-2,), samples=(400,))
    factors = {method: factor for method, factor, _ in noise_methods.ranking(result)}
    assert factors["structured"] < min(factors["truncation"], factors["regression"])
    assert noise_methods.table(result).count("\n") == 1 + len(noise_methods.families())
    (path,) = noise_methods.plot(result, tmp_path)
    assert path.exists()


def test_exact_histories_leave_no_floor() -> None:
    """Without noise every pooled method sees any bias: the floor is rounding."""
    result = noise_methods.run(0, trials=1, noise_std=(0.0,), samples=(40,))
    pooled = [noise_methods.METHODS.index(name) for name in noise_methods.METHODS if name != "averaging"]
    assert np.nanmax(result.smallest[:, :, :, pooled]) < 1e-6
