"""The figures of the delayed observers on DGU 1."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from dcmg_bringup.papers import delayed

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture(scope="module")
def result() -> delayed.DelayedResult:
    """The experiment."""
    return delayed.run()


def test_figures_of_the_page_come_out(result: delayed.DelayedResult) -> None:
    """Every gamma, the pole, and no bound exceeded in 10^4 random and 100 optimised runs."""
    assert not [check for check in delayed.checks(result) if not check.ok]


def test_bounds_from_data_come_close_to_those_of_the_model(result: delayed.DelayedResult) -> None:
    """With 320 samples the data-driven bound is within 10 % of the model's: sampling, 1 / sqrt(N)."""
    assert np.max(result.bound_error[-1]) < 0.1


def test_figure_is_written(result: delayed.DelayedResult, tmp_path: Path) -> None:
    """One PNG with four panels."""
    (path,) = delayed.plot(result, tmp_path / "figures")
    assert path.name == "delayed.png"
    assert path.read_bytes().startswith(b"\x89PNG")
