"""What is accepted is true on samples that the design has not seen."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from monitor.history import Experiment, History, single
from monitor.observers import LinearObserver, design
from monitor.proof import Allowance, Trial, hold_back, prove, stretches
from monitor.trials import try_observer
from monitor.wording import describe

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.monitor.conftest import Plant


def test_the_tail_is_held_back_with_the_sample_before_it() -> None:
    """Of 50 samples the last 10 are unseen; the sample before them starts the observer."""
    x = np.arange(50.0)[:, None]
    split = hold_back(single(np.zeros((50, 0)), x, x, 0.01))
    assert split.seen.experiments[0].x[-1, 0] == 39.0
    assert split.unseen.experiments[0].x[:, 0].tolist() == list(np.arange(39.0, 50.0))


def test_whole_experiments_are_held_back_where_there_are_several() -> None:
    """Every fifth of ten experiments; nothing is lost and nothing is seen twice."""
    experiments = tuple(Experiment(np.zeros((9, 0)), np.full((9, 1), k), np.full((9, 1), k)) for k in range(10))
    split = hold_back(History(experiments, 0.01))
    seen, unseen = ([one.x[0, 0] for one in part.experiments] for part in (split.seen, split.unseen))
    assert len(unseen) == 2
    assert sorted(seen + unseen) == list(range(10))


def test_a_gap_starts_a_new_stretch() -> None:
    """No stretch bridges a missing value."""
    x = np.arange(9.0)[:, None]
    x[4] = np.nan
    parts = list(stretches(single(np.zeros((9, 0)), x, x, 0.01)))
    assert [one.x[:, 0].tolist() for one in parts] == [[0.0, 1.0, 2.0, 3.0], [5.0, 6.0, 7.0, 8.0]]


@pytest.mark.parametrize("number", range(1, 7))
def test_the_certificate_holds_what_the_observer_did(dgu_history: Callable[..., History], number: int) -> None:
    """Its figures are those of a run over the held-back samples; the observer does not depend on them."""
    history = dgu_history(number, samples=50)
    made = design("full_order", history, {})
    assert isinstance(made.observer, LinearObserver)
    proof = made.certificate.proof
    assert proof is not None
    (trial,) = try_observer(made.observer, hold_back(history).unseen)
    assert proof.samples == len(trial.error) == 10
    assert proof.spare_columns == 39 - 5
    # both are rounding; the two runs are in other units
    assert np.max(np.abs(trial.error)) < 1e-10
    assert np.max(proof.errors) < 1e-10
    assert proof.words() in made.verdict
    assert any(line.startswith("proof: on 10 unseen samples: estimate within") for line in describe(made.certificate))
    one = history.experiments[0]
    bent = replace(history, experiments=(replace(one, y=np.vstack([one.y[:-1], one.y[-1:] + 0.01])),))
    refused = design("full_order", bent, {})
    assert "not true on 10 unseen samples" in refused.verdict
    assert refused.certificate.matrices is not None
    assert np.array_equal(refused.certificate.matrices["D"], made.observer.D)


def test_noise_is_held_against_noise(dgu: Callable[[int], Plant]) -> None:
    """A noisy design passes with the noise as its allowance, and fails when the plant has changed meanwhile."""
    history = dgu(1).history(np.random.default_rng(0), samples=200, mean=(11.0, 50.0), noise_std=1e-3)
    made = design("full_order", history, {"unknown_inputs": 2})
    proof = made.certificate.proof
    assert proof is not None
    assert proof.holds
    assert proof.basis == "the noise on the samples seen"
    other = dgu(2).history(np.random.default_rng(1), samples=200, mean=(11.0, 50.0), noise_std=1e-3)
    first, second = history.experiments[0], other.experiments[0]
    x = np.vstack([first.x[:160], second.x[160:]])
    assert "not true on" in design("full_order", single(first.u, x, x, 0.01), {"unknown_inputs": 2}).verdict


def test_an_overflow_is_no_proof() -> None:
    """NaN is never within an allowance."""
    trial = Trial(error=np.array([[np.nan]]), residual=np.zeros((1, 1)))
    allowed = Allowance(error=1.0, residual=1.0, basis="rounding")
    proof = prove([trial], allowed, (np.ones(1), np.ones(1)), spare_columns=3)
    assert not proof.holds
