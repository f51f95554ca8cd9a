"""Inputs that act on outputs at once, y = C x + G d, are reconstructed; one that acts on nothing is refused as such."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from monitor import input_estimators
from monitor.history import Experiment, History

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

SEEDS = range(60)
OPTIONS: dict[str, dict[str, object]] = {
    "one_step": {"observer_options": {"strategy": "dual_lqr", "decay": 0.9}},
    "delayed": {"delay": 2, "goal": "exact"},
}


def draw(seed: int) -> tuple[np.random.Generator, tuple[Floats, Floats, Floats, Floats]]:
    """A stable plant with at least one output more than inputs; every third has an input that moves no state."""
    generator = np.random.default_rng(seed)
    n, m_d = int(generator.integers(2, 5)), int(generator.integers(1, 3))
    p = int(generator.integers(m_d + 1, n + 2))
    A = generator.standard_normal((n, n))
    A *= 0.8 / np.max(np.abs(np.linalg.eigvals(A)))
    E, C, G = (generator.standard_normal(shape) for shape in ((n, m_d), (p, n), (p, m_d)))
    if seed % 3 == 0:
        E[:, 0] = 0.0
    return generator, (A, E, C, G)


def run(
    generator: np.random.Generator, plant: tuple[Floats, Floats, Floats, Floats], samples: int
) -> tuple[Floats, Floats, Floats]:
    """States, inputs and outputs of a random run."""
    A, E, C, G = plant
    d, x = generator.uniform(-1.0, 1.0, (samples, E.shape[1])), [generator.uniform(-1.0, 1.0, len(A))]
    for applied in d[:-1]:
        x.append(A @ x[-1] + E @ applied)
    states = np.array(x)
    return states, d, states @ C.T + d @ G.T


@pytest.mark.parametrize("kind", OPTIONS)
def test_inputs_that_reach_outputs_at_once_are_reconstructed(kind: str) -> None:
    """Whatever is accepted gives d of a fresh run; most random plants with as many extra outputs are accepted."""
    accepted = 0
    for seed in SEEDS:
        generator, plant = draw(seed)
        x, d, y = run(generator, plant, 120)
        made = input_estimators.design(
            kind, History((Experiment(np.empty((120, 0)), y, x, None, d),), 0.1), OPTIONS[kind]
        )
        if made.estimator is None:
            assert "refused" in made.verdict
            continue
        accepted += 1
        _, applied, received = run(generator, plant, 300)
        state, found = made.estimator.init(received[0].tolist()), []
        for sample in received.tolist():
            state, estimate = made.estimator.step(state, sample)
            found.append([float(value) for value in estimate])
        lag = made.estimator.lag
        assert np.max(np.abs(np.array(found)[200:] - applied[200 - lag : 300 - lag])) < 1e-6, (seed, made.verdict)
    assert accepted > len(SEEDS) // 2


@pytest.mark.parametrize("kind", OPTIONS)
def test_an_input_that_acts_on_nothing_is_named(kind: str) -> None:
    """Its column of E and G is rounding, which no proof should have to find out."""
    generator, (A, E, C, G) = draw(0)
    x, d, y = run(generator, (A, 0.0 * E, C, 0.0 * G), 120)
    made = input_estimators.design(kind, History((Experiment(np.empty((120, 0)), y, x, None, d),), 0.1), OPTIONS[kind])
    assert made.estimator is None
    assert "d[0] acts on nothing" in made.verdict
