"""Attacks on messages as a whole: scaling, freeze, delay, drop, replay."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from dgu_sim.attacks import build_attack
from dgu_sim.records import Sample

Outputs = list[tuple[float, ...]]
Apply = Callable[..., list[tuple[Sample, ...]]]


def test_scaling_multiplies_each_component(outputs: Outputs, apply: Apply) -> None:
    """y^c = gain y, and delivered stays."""
    attack = build_attack("scaling", {"gain": [1.0, 0.5, -2.0]})
    for y, (first, second) in zip(outputs, apply(attack, outputs), strict=True):
        assert list(first.y) == list(second.y) == [y[0], 0.5 * y[1], -2.0 * y[2]]
        assert first.delivered is True


def test_freeze_repeats_the_first_sample(outputs: Outputs, apply: Apply) -> None:
    """Every sample is the one at the attack's start."""
    assert all(one.y == outputs[0] for samples in apply(build_attack("freeze", {}), outputs) for one in samples)


@pytest.mark.parametrize("samples", [1, 7])
def test_delay_delivers_what_was_sent_before(outputs: Outputs, apply: Apply, samples: int) -> None:
    """y^c_k = y_(k - d); the first sample until there is one so old."""
    received = apply(build_attack("delay", {"samples": samples}), outputs)
    assert [one[0].y for one in received] == [outputs[max(0, k - samples)] for k in range(len(outputs))]


def test_replay_records_and_plays_in_a_loop(outputs: Outputs, apply: Apply) -> None:
    """The first half second passes and is then heard again and again."""
    received = apply(build_attack("replay", {"record_sec": 0.5}), outputs)
    assert [one[1].y for one in received] == [outputs[k % 50] for k in range(len(outputs))]


def test_denial_of_service_loses_everything(outputs: Outputs, apply: Apply) -> None:
    """With probability 1 nothing is delivered, and what is not delivered is NaN."""
    for samples in apply(build_attack("drop", {}), outputs):
        assert all(not one.delivered and all(math.isnan(value) for value in one.y) for one in samples)


def test_drop_loses_its_share_and_leaves_the_rest_alone(outputs: Outputs, apply: Apply) -> None:
    """A share of 0.3 within four standard errors; what gets through is unchanged; links lose independently."""
    received = apply(build_attack("drop", {"probability": 0.3}), outputs)
    lost = np.array([[not one.delivered for one in samples] for samples in received])
    assert np.abs(lost.mean(axis=0) - 0.3).max() < 4.0 * math.sqrt(0.3 * 0.7 / 600)
    assert not np.array_equal(lost[:, 0], lost[:, 1])
    for y, samples in zip(outputs, received, strict=True):
        assert all(tuple(one.y) == y for one in samples if one.delivered)


def test_runs_in_arrays_lose_and_draw_what_each_run_alone_does(outputs: Outputs, apply: Apply) -> None:
    """Floats and arrays agree bit for bit for attacks that draw random numbers."""
    for kind, parameters in (("drop", {"probability": 0.4}), ("bias_random", {"spread": [1, 2, 3]})):
        attack = build_attack(kind, parameters)
        together = apply(attack, outputs, seed=(3, 8))
        for run, seed in enumerate((3, 8)):
            for samples, alone in zip(together, apply(attack, outputs, seed=seed), strict=True):
                for one, expected in zip(samples, alone, strict=True):
                    assert [float(np.asarray(value)[run]) for value in one.y] == pytest.approx(
                        list(expected.y), rel=0, abs=0, nan_ok=True
                    )
                    assert bool(np.broadcast_to(one.delivered, 2)[run]) == expected.delivered
