"""The oracles of Turan and Ferrari-Trecate (2021), whatever the data seed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from dcmg.papers import turan_2021

if TYPE_CHECKING:
    from pathlib import Path

SEEDS = range(8)


@pytest.mark.parametrize("seed", SEEDS)
def test_numbers_of_the_paper_come_out_whatever_the_data(seed: int) -> None:
    """A, E, eig A_UIO of all six DGUs, r(50) and the steady residual hold to 1e-4 for every history."""
    failed = [check for check in turan_2021.checks(turan_2021.run(seed)) if not check.ok]
    assert not failed


def test_every_oracle_of_the_page_is_checked() -> None:
    """15 entries of A and E, 3 + 3 residuals and 18 eigenvalues."""
    assert len(turan_2021.checks(turan_2021.run(0))) == 9 + 6 + 6 + 18


@pytest.mark.parametrize("seed", SEEDS)
def test_estimates_converge_without_attack(seed: int) -> None:
    """After ten steps the estimate of a wrongly started observer is the state (Figure 2)."""
    result = turan_2021.run(seed)
    # The error shrinks by 0.1714 a step: 0.17 * 0.1714**10 < 1e-8.
    assert np.max(np.abs(result.estimate - result.x)[10:50]) < 1e-7


def test_figures_are_written(tmp_path: Path) -> None:
    """Figures 2 and 3 become two PNG files."""
    paths = turan_2021.plot(turan_2021.run(0), tmp_path / "figures")
    assert [path.name for path in paths] == ["turan_2021_fig2.png", "turan_2021_fig3.png"]
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in paths)
