"""Secondary consensus control."""

import math

import numpy as np

from dgu_sim.grid import Grid, Line
from dgu_sim.parameters import DguParameters
from dgu_sim.records import Sample
from dgu_sim.secondary import consensus_of, consensus_of_all

PARAMETERS = DguParameters(R_t=0.2, L_t=1.8e-3, C_t=2.2e-3, k1=-2.134, k2=-0.163, k3=13.553)
PAIRS = ((1, 2), (1, 3), (2, 4), (3, 4), (1, 4))
GRID = Grid(
    dgus=(1, 2, 3, 4),
    parameters=dict.fromkeys((1, 2, 3, 4), PARAMETERS),
    lines=tuple(Line(between=pair, resistance_ohm=0.05) for pair in PAIRS),
)
RATED = (1.0, 1.25, 1.5, 2.0)


def _heard(current: float, *, delivered: bool = True) -> Sample:
    return Sample(y=(48.0, current, 1.0), delivered=delivered)


def test_equation() -> None:
    """alpha+ = alpha + T_s k_I sum_j (I_j/I^r_j - I_i/I^r_i)."""
    control = consensus_of(GRID, RATED, 0.001, 1)
    alpha = control.step(0.5, 3.0, [_heard(2.0), _heard(6.0), _heard(1.0)])
    expected = 0.5 + 0.001 * ((2.0 / 1.25 - 3.0) + (6.0 / 1.5 - 3.0) + (1.0 / 2.0 - 3.0))
    assert abs(float(alpha) - expected) < 1e-15


def test_a_lost_or_nan_sample_drops_its_term_only() -> None:
    """What is not delivered, or is NaN, leaves the other neighbours' terms alone."""
    control = consensus_of(GRID, RATED, 0.001, 1)
    expected = 0.5 + 0.001 * (6.0 / 1.5 - 3.0)
    lost = [_heard(2.0, delivered=False), _heard(6.0), _heard(math.nan)]
    assert abs(float(control.step(0.5, 3.0, lost)) - expected) < 1e-15


def test_sum_of_alpha_is_conserved_without_attack() -> None:
    """1'alpha does not move when everyone hears the truth: the eigenvalue that is exactly 1."""
    currents = dict(zip(GRID.dgus, (3.0, 5.0, 1.0, 8.0), strict=True))
    total = 0.0
    for dgu in GRID.dgus:
        heard = [_heard(currents[other]) for other in GRID.neighbours(dgu)]
        total += float(consensus_of(GRID, RATED, 0.01, dgu).step(0.0, currents[dgu], heard))
    assert abs(total) < 1e-15


def test_all_dgus_at_once_give_the_bits_of_each() -> None:
    """The stacked controllers, empty slots and lost samples included, equal each controller in floats."""
    rng = np.random.default_rng(1)
    slots = max(len(GRID.neighbours(dgu)) for dgu in GRID.dgus)
    y = rng.normal(10.0, 3.0, (slots, 3, 2, 4))
    y[0, 1, 0, 2] = np.nan
    delivered = rng.random((slots, 2, 4)) > 0.3
    for dgu in GRID.dgus:
        delivered[len(GRID.neighbours(dgu)) :, :, dgu - 1] = False
    own, alpha = rng.normal(10.0, 3.0, (2, 4)), rng.normal(0.0, 1.0, (2, 4))
    control = consensus_of_all(GRID, RATED, 0.01)
    received = [Sample(y=y[slot], delivered=delivered[slot]) for slot in range(slots)]
    together = np.asarray(control.step(alpha, own, received))
    for dgu in GRID.dgus:
        alone = consensus_of(GRID, RATED, 0.01, dgu)
        for run in range(2):
            heard = [
                Sample(y=y[slot, :, run, dgu - 1].tolist(), delivered=bool(delivered[slot, run, dgu - 1]))
                for slot in range(len(GRID.neighbours(dgu)))
            ]
            assert alone.step(float(alpha[run, dgu - 1]), float(own[run, dgu - 1]), heard) == together[run, dgu - 1]
