"""What learning from noisy data costs, measured on a few runs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from dcmg.papers import data_gap

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture(scope="module")
def result() -> data_gap.GapResult:
    """Five runs, one of V only."""
    return data_gap.run(runs=5, slow_runs=1)


def test_knowing_the_model_is_never_worse(result: data_gap.GapResult) -> None:
    """Where unknown inputs are cancelled; the data-driven gap is below a factor 2 at noise 1e-3."""
    assert not [check for check in data_gap.checks(result) if not check.ok]
    for problem in data_gap.PROBLEMS:
        model, data, _ = np.nanmean(result.errors[problem.name][0], axis=1)
        assert data < 2.0 * model, problem.name


def test_the_best_behaviour_beats_least_squares_under_noise(result: data_gap.GapResult) -> None:
    """At noise 1e-2, UIO and delayed observer from data leave less error than those of an identified model."""
    for name in ("UIO, y = x", "delayed 1, y = (V, I_t)"):
        _, data, identification = np.mean(result.errors[name][1], axis=1)
        assert data < identification, name


def test_table_and_figure_are_written(result: data_gap.GapResult, tmp_path: Path) -> None:
    """One line a problem and noise level, refusals counted; one PNG."""
    lines = [line for line in data_gap.notes(result) if line.startswith("| ")]
    assert len(lines) == 1 + len(data_gap.PROBLEMS) * len(data_gap.NOISE_STD)
    (path,) = data_gap.plot(result, tmp_path)
    assert path.read_bytes().startswith(b"\x89PNG")
