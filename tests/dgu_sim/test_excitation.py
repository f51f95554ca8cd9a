"""Excitations of the offline experiment: within their range, exciting enough, the same for the same seed."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dgu_sim.excitation import MultisineExcitation, PrbsExcitation, UniformExcitation
from dgu_sim.experiment import run_experiments
from dgu_sim.grid_experiment import run_grid_experiments
from dgu_sim.linear import FloatArray
from dgu_sim.scenario import Scenario

KINDS = (UniformExcitation(), PrbsExcitation(kind="prbs"), MultisineExcitation(kind="multisine"))
NAMES = ("uniform", "prbs", "multisine")
ORDER = 5  # n + 2 for the three states of a DGU (T, assumption 6)


def _hankel(signals: FloatArray, depth: int) -> FloatArray:
    """Windows of `depth` samples of all signals, side by side."""
    columns = signals.shape[1] - depth + 1
    return np.vstack([signals[:, row : row + columns] for row in range(depth)])


def _excited(matrix: FloatArray) -> float:
    """Smallest over largest singular value, rows scaled alike."""
    values = np.linalg.svd(matrix / np.linalg.norm(matrix, axis=1, keepdims=True), compute_uv=False)
    return float(values[-1] / values[0])


@pytest.mark.parametrize("excitation", KINDS, ids=NAMES)
@given(seed=st.integers(0, 10**6), count=st.integers(1, 12), windows=st.integers(2, 8))
def test_signals_stay_in_range_and_excite_jointly(
    excitation: UniformExcitation | PrbsExcitation | MultisineExcitation, seed: int, count: int, windows: int
) -> None:
    """All signals together are persistently exciting of order n + 2, in records of twice as many columns as rows on."""
    samples = (1 + windows) * count * ORDER
    drawn = excitation.signals(np.random.default_rng(seed), count, samples)
    assert drawn.shape == (count, samples)
    assert np.abs(drawn).max() <= 1.0
    assert _excited(_hankel(drawn, ORDER)) > 1e-4
    assert np.array_equal(drawn, excitation.signals(np.random.default_rng(seed), count, samples))


def test_uniform_draws_are_those_of_the_generator() -> None:
    """What was recorded before there was a choice is recorded still, bit for bit."""
    drawn, plain = np.random.default_rng(3), np.random.default_rng(3)
    assert np.array_equal(UniformExcitation().signals(drawn, 2, 20), plain.uniform(-1.0, 1.0, (2, 20)))
    assert np.array_equal(UniformExcitation().rows(drawn, 4, 20), plain.uniform(-1.0, 1.0, (20, 2, 2)).reshape(20, 4))


def test_a_multisine_has_the_tones_that_are_asked_for() -> None:
    """Its spectrum holds these harmonics alone; it is persistently exciting of order 2 tones and no more."""
    drawn = MultisineExcitation(kind="multisine", tones=3).signals(np.random.default_rng(0), 1, 64)
    spectrum = np.abs(np.fft.rfft(drawn[0]))
    assert np.count_nonzero(spectrum > 1e-6 * spectrum.max()) == 3
    assert _excited(_hankel(drawn, 6)) > 1e-3
    assert _excited(_hankel(drawn, 7)) < 1e-9


def test_a_prbs_is_held_as_long_as_is_asked_for() -> None:
    """Values are -1 and 1 and change at multiples of the hold only."""
    (drawn,) = PrbsExcitation(kind="prbs", hold_samples=4).signals(np.random.default_rng(0), 1, 62)
    assert set(drawn.tolist()) == {-1.0, 1.0}
    assert set(np.flatnonzero(np.diff(drawn)) % 4) == {3}


@pytest.mark.parametrize("kind", NAMES)
@pytest.mark.parametrize("scenario_name", ["isolated_dgu_1", "gallo_six_dgu"])
def test_every_excitation_teaches_a_dgu(shipped: Callable[..., Scenario], scenario_name: str, kind: str) -> None:
    """20 samples show rank n + m_d = 5 whatever the seed, another record for another experiment."""
    for seed in range(1, 21):
        scenario = shipped(
            scenario_name, f"history.excitation={{kind: {kind}}}", f"seed={seed}", "history.experiments=2"
        )
        one, two = run_experiments(scenario, 1)
        stacked = np.vstack([one.x[:-1].T, one.x[1:].T])
        scaled = stacked / np.linalg.norm(stacked, axis=1, keepdims=True)
        assert np.linalg.matrix_rank(scaled, tol=1e-10) == 5
        assert not np.array_equal(one.d, two.d)


@pytest.mark.parametrize("kind", NAMES)
def test_every_excitation_teaches_a_team(shipped: Callable[..., Scenario], kind: str) -> None:
    """120 samples of six DGUs show all 18 states and 12 inputs."""
    (data,) = run_grid_experiments(shipped("team_six_dgu", f"history.excitation={{kind: {kind}}}"), 120)
    assert _excited(np.vstack([data.x[:-1].T, data.u[:-1].T])) > 1e-8
