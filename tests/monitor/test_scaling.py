"""Units do not matter: the same decision, and the observer is the rescaled one."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from monitor.observers import LinearObserver, design
from monitor.scaling import norms, spreads

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from monitor.history import History
    from tests.monitor.conftest import Plant, RandomCase


def rescaled(history: History, u: NDArray[np.float64], y: NDArray[np.float64], x: NDArray[np.float64]) -> History:
    """The same history in other units."""
    changed = (replace(one, u=one.u * u, y=one.y * y, x=one.x * x) for one in history.experiments)
    return replace(history, experiments=tuple(changed), comparable=False)


def check_the_same_in_other_units(kind: str, history: History, options: dict[str, object], seed: int) -> bool:
    """Design in both units, and hold the one against the other; returns whether there is an observer."""
    generator = np.random.default_rng(seed)
    factors = [10.0 ** generator.uniform(-8.0, 8.0, getattr(history.experiments[0], name).shape[1]) for name in "uyx"]
    u, y, x = factors
    scaled_options = dict(options)
    if "noise_std" in options:
        std = np.broadcast_to(np.asarray(options["noise_std"], dtype=float), x.shape)
        scaled_options["noise_std"] = tuple((std * x).tolist())
    made = design(kind, replace(history, comparable=False), options)
    other = design(kind, rescaled(history, u, y, x), scaled_options)
    assert made.accepted == other.accepted, (seed, made.verdict, other.verdict)
    if not isinstance(made.observer, LinearObserver):
        return False
    assert isinstance(other.observer, LinearObserver)
    into = np.concatenate([u, y])
    for name, out in (("D", x), ("J", y)):
        first, second = getattr(made.observer, name), getattr(other.observer, name)
        expected = out[:, None] * first / into
        size = out[:, None] / into * max(1.0, float(np.max(np.abs(first), initial=0.0)))
        assert np.all(np.abs(second - expected) <= 1e-6 * size), (seed, name)
    assert np.allclose(
        np.sort(np.abs(np.linalg.eigvals(made.observer.A))),
        np.sort(np.abs(np.linalg.eigvals(other.observer.A))),
        atol=1e-6,
    )
    return True


@pytest.mark.parametrize("kind", ["full_order"])
def test_random_plants_in_random_units(random_cases: list[RandomCase], kind: str) -> None:
    """Any diagonal rescaling within 1e-8 to 1e8 leaves the decision, and rescales the observer."""
    options = {"strategy": "dual_lqr", "decay": 0.9, "allow_blind": True}
    found = [check_the_same_in_other_units(kind, case.history, options, case.seed) for case in random_cases[:60]]
    assert sum(found) > 10


@pytest.mark.parametrize("number", range(1, 7))
def test_noisy_histories_in_random_units(dgu: Callable[[int], Plant], number: int) -> None:
    """Noise of known size, scaled along, or of known rank: the same."""
    history = dgu(number).history(np.random.default_rng(number), samples=200, mean=(11.0, 50.0), noise_std=1e-3)
    for options in ({"noise_std": 1e-3}, {"unknown_inputs": 2}):
        assert check_the_same_in_other_units("full_order", history, dict(options), number)


def test_scales_are_spreads_of_what_is_there(dgu: Callable[[int], Plant]) -> None:
    """Gaps do not count, huge and tiny signals neither overflow nor vanish, and a still signal has its size."""
    history = dgu(1).history(np.random.default_rng(0), samples=50)
    one = history.experiments[0]
    x = one.x * np.array([1e300, 1e-300, 1.0])
    x[:, 2] = 7.0
    x[3] = np.nan
    scales = spreads(replace(history, experiments=(replace(one, x=x),)))
    kept = np.delete(one.x, 3, axis=0)
    assert np.allclose(scales.x / np.array([1e300, 1e-300, 1.0]), [*np.std(kept, axis=0)[:2], 7.0], rtol=1e-12)


def test_norms_are_taken_in_comparable_units_only(dgu: Callable[[int], Plant]) -> None:
    """The units of a DGU count as they are; the same signals in micro-amperes are not believed to be comparable."""
    history = dgu(1).history(np.random.default_rng(0), samples=50)
    assert np.all(norms(history, spreads(history)).x == 1.0)
    other = replace(
        rescaled(history, np.ones(0), np.array([1.0, 1e6, 1.0]), np.array([1.0, 1e6, 1.0])), comparable=True
    )
    assert np.array_equal(norms(other, spreads(other)).x, spreads(other).x)
