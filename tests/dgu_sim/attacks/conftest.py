"""Attacks by hand: one attack on the samples of its links, in floats or in arrays over runs."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from dgu_sim.attacks import Attack, AttackContext
from dgu_sim.grid import Link
from dgu_sim.records import Sample

T_S = 0.01
LINKS = (Link(1, 2), Link(1, 3))


@pytest.fixture(name="outputs", scope="session")
def _outputs() -> list[tuple[float, ...]]:
    """600 samples of one DGU, all different: more than two blocks of random numbers."""
    return [(48.0 + 0.01 * k, 10.0 - 0.002 * k, 3.0 + 0.001 * k * k) for k in range(600)]


@pytest.fixture(name="apply", scope="session")
def _apply() -> Callable[..., list[tuple[Sample, ...]]]:
    """Step an attack over the same samples on two links."""

    def run(
        attack: Attack, outputs: Sequence[Sequence[float]], seed: int | tuple[int, ...] = 5, number: int = 1
    ) -> list[tuple[Sample, ...]]:
        state = attack.init(AttackContext(links=LINKS, sampling_period_sec=T_S, seed=seed, number=number))
        delivered = []
        for y in outputs:
            one = Sample(y=y if isinstance(seed, int) else np.array(y)[:, None] * np.ones(len(seed)))
            state, samples = attack.step(state, [one, one])
            delivered.append(samples)
        return delivered

    return run


@pytest.fixture(name="phi", scope="session")
def _phi(apply: Callable[..., list[tuple[Sample, ...]]]) -> Callable[..., np.ndarray]:
    """Return what an attack adds to each sample, shape (steps, links, 3)."""

    def added(attack: Attack, outputs: Sequence[Sequence[float]], **options: int) -> np.ndarray:
        received = np.array([[sample.y for sample in samples] for samples in apply(attack, outputs, **options)])
        return np.asarray(received - np.array(outputs)[:, None, :])

    return added
