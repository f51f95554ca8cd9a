"""The oracles of Shi, Lian and Jones (2022)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from dcmg.papers import uie, uie_co2
from monitor.input_reconstruction import design

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture(scope="module")
def result() -> uie.UieResult:
    """The experiment with the authors' seed."""
    return uie.run()


def test_numbers_of_the_page_come_out(result: uie.UieResult) -> None:
    """Spectral radii .7216/.7797 (op-UIE) and .6751/.7797 (cl-UIE), both zeros, and errors that vanish."""
    assert not [check for check in uie.checks(result) if not check.ok]


def test_a_plant_with_a_zero_outside_the_circle_is_refused_by_it() -> None:
    """The same A, B, C with D = diag(2, -2): the record shows the unstable zero, the verdict names it."""
    feedthrough = np.diag([2.0, -2.0])
    zeros = np.linalg.eigvals(uie.A - uie.B @ np.linalg.solve(feedthrough, uie.C))
    (unstable,) = zeros[np.abs(zeros) >= 1.0]
    u, y = uie._trajectory(feedthrough, uie.AUTHORS_SEED, uie.SAMPLES, 0.0)
    for kind in ("op_uie", "cl_uie"):
        made = design(kind, uie._record(u, y), {"past": uie.PAST})
        assert not made.accepted
        assert f"the record shows the zeros {unstable.real:.4g}, expected modulus < 1" in made.verdict


def test_noise_favours_the_closed_loop_without_truncation(result: uie.UieResult) -> None:
    """As the paper says, cl-UIE bears noise better than op-UIE; truncating to the right rank makes them equal."""
    open_loop, closed_loop, open_truncated, closed_truncated = result.noise_error.T
    assert np.all(closed_loop < open_loop)
    # A tenth: both use the same [U1 Y1], only the correction of the first error differs.
    assert np.allclose(open_truncated, closed_truncated, rtol=0.1)


def test_figures_are_written(result: uie.UieResult, tmp_path: Path) -> None:
    """Two PNG files: inputs with errors, and the noise study."""
    paths = uie.plot(result, tmp_path / "figures")
    assert [path.name for path in paths] == ["uie_fig2.png", "uie_noise.png"]
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in paths)


def test_occupancy_on_the_synthetic_building(tmp_path: Path) -> None:
    """Exact without noise; with it far better than regression on the present CO2, close to regressions on windows."""
    found = uie_co2.run()
    assert not [check for check in uie_co2.checks(found) if not check.ok]
    estimator, present, window, process = found.mae
    assert estimator < 0.5 * present
    # As written in the docs: on this building both regressions on windows win by up to a half.
    assert max(window, process) < estimator < 1.6 * min(window, process)
    (path,) = uie_co2.plot(found, tmp_path)
    assert path.read_bytes().startswith(b"\x89PNG")
