"""T's definition 5: which trajectories fit a history, in exact and noisy data, whatever the units."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor.compatibility import compatible
from monitor.errors import MonitorError
from monitor.history import Experiment, History

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from tests.monitor.conftest import Plant

    Floats = NDArray[np.float64]

MEAN = np.array([11.0, 50.0])


def _run(plant: Plant, seed: int, steps: int = 60) -> tuple[Floats, Floats]:
    generator = np.random.default_rng(seed)
    d = MEAN + generator.uniform(-1.0, 1.0, (steps, 2))
    return plant.run(generator.uniform(-1.0, 1.0, 3), np.zeros((steps, 0)), d)


@pytest.mark.parametrize("known", ["outputs", "states"])
def test_what_the_plant_can_do_fits_and_another_plant_does_not(
    dgu: Callable[[int], Plant], dgu_history: Callable[..., History], known: str
) -> None:
    """Trajectories of DGU 1 under other inputs are compatible with its history, those of DGU 2 are not."""
    history, nothing = dgu_history(1), np.zeros((60, 0))
    for number, fits in ((1, True), (2, False)):
        y, x = _run(dgu(number), 5)
        found = compatible(history, nothing, y, x=x if known == "states" else None)
        assert found.fits is fits, found.verdict
        assert (found.first is None) == fits
        assert found.verdict.startswith("fits" if fits else "does not fit")


def test_it_says_from_when_on_it_does_not_fit(dgu: Callable[[int], Plant], dgu_history: Callable[..., History]) -> None:
    """A bias from sample 40 on first shows in the window that ends there; a gap is not judged."""
    y, _ = _run(dgu(1), 6)
    y[40:, 0] += 0.1
    y[10, 1] = np.nan
    found = compatible(dgu_history(1), np.zeros((60, 0)), y)
    assert found.first == 40 - found.window + 1
    assert np.isnan(found.misfit[11 - found.window : 11]).all()
    assert np.isfinite(found.misfit[11])


def test_outputs_that_unknown_inputs_explain_say_nothing(
    dgu: Callable[[int], Plant], dgu_history: Callable[..., History]
) -> None:
    """Two unknown inputs and two outputs: whatever is received is compatible, and that is said instead of yes."""
    full = dgu_history(1)
    history = replace(full, experiments=tuple(replace(one, y=one.y[:, :2]) for one in full.experiments))
    y, _ = _run(dgu(2), 5)
    found = compatible(history, np.zeros((60, 0)), y[:, :2])
    assert found.fits is None
    assert "every trajectory" in found.verdict


@given(seed=st.integers(0, 10**6))
def test_units_do_not_matter(dgu_1: Plant, history_1: History, seed: int) -> None:
    """The same misfits, in shares of what is allowed, with every signal in another unit."""
    y, _ = _run(dgu_1, 7)
    y[30:, 1] += 0.01
    generator = np.random.default_rng(seed)
    of_y, of_x = 10.0 ** generator.uniform(-8.0, 8.0, 3), 10.0 ** generator.uniform(-8.0, 8.0, 3)
    scaled = tuple(Experiment(one.u, one.y * of_y, one.x * of_x) for one in history_1.experiments)
    here = compatible(history_1, np.zeros((60, 0)), y)
    there = compatible(History(scaled, history_1.sampling_period_sec), np.zeros((60, 0)), y * of_y)
    assert (here.fits, here.first) == (there.fits, there.first) == (False, 31 - here.window)
    np.testing.assert_allclose(here.misfit, there.misfit, rtol=1e-6, atol=1e-9)


def test_noise_is_allowed_for(dgu: Callable[[int], Plant], dgu_history: Callable[..., History]) -> None:
    """A noisy history and a noisy stream fit; a bias far above the noise does not, one far below it is not seen."""
    history = dgu_history(1, samples=200, noise_std=1e-3)
    y, _ = _run(dgu(1), 8, 400)
    y = y + 1e-3 * np.random.default_rng(0).standard_normal(y.shape)
    options: dict[str, object] = {"unknown_inputs": 2, "received_std": 1e-3}
    nothing = np.zeros((400, 0))
    assert compatible(history, nothing, y, options).fits
    for bias, fits in ((1.0, False), (1e-4, True)):
        biased = y + np.where(np.arange(400) >= 200, bias, 0.0)[:, None]
        assert compatible(history, nothing, biased, options).fits is fits


def test_a_history_that_tells_nothing_is_refused(dgu_history: Callable[..., History]) -> None:
    """Too few samples: the reason, no verdict; another number of outputs is misuse."""
    y = np.zeros((30, 3))
    found = compatible(dgu_history(1, samples=4), np.zeros((30, 0)), y)
    assert found.fits is None
    assert "record longer" in found.verdict
    with pytest.raises(MonitorError, match="y has shape"):
        compatible(dgu_history(1), np.zeros((30, 0)), y[:, :2])


@pytest.fixture(name="dgu_1", scope="module")
def _dgu_1() -> Plant:
    from tests.monitor.conftest import dgu_plant  # noqa: PLC0415 (hypothesis wants fixtures that outlive an example)

    return dgu_plant(1)


@pytest.fixture(name="history_1", scope="module")
def _history_1(dgu_1: Plant) -> History:
    return dgu_1.history(np.random.default_rng(0), samples=20, mean=(11.0, 50.0))
