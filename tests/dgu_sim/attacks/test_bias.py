"""Additive bias."""

import numpy as np

from dgu_sim.attacks import AttackContext, Bias
from dgu_sim.grid import Link
from dgu_sim.records import Sample

CONTEXT = AttackContext(links=(Link(1, 2),), sampling_period_sec=0.01)


def test_bias_is_added_to_every_component() -> None:
    """y^c = y + phi, and whether the sample was delivered stays as it is."""
    attack = Bias(bias=(0.1, 0.2, -0.3))
    _, (sample,) = attack.step(attack.init(CONTEXT), [Sample(y=(1.0, 2.0, 3.0), delivered=False)])
    assert list(sample.y) == [1.0 + 0.1, 2.0 + 0.2, 3.0 - 0.3]
    assert sample.delivered is False


def test_bias_acts_on_all_runs_at_once() -> None:
    """With arrays every run gets the bits that floats get."""
    attack = Bias(bias=(0.1, 0.2, -0.3))
    y = np.array([[1.0, 1.5], [2.0, 2.5], [3.0, 3.5]])
    _, (sample,) = attack.step(attack.init(CONTEXT), [Sample(y=y)])
    for run in range(2):
        _, (alone,) = attack.step(attack.init(CONTEXT), [Sample(y=y[:, run].tolist())])
        assert [float(np.asarray(component)[run]) for component in sample.y] == list(alone.y)
