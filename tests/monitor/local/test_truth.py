"""The module of the own state in other units, and on samples that its design has not seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from monitor import local
from monitor.history import Experiment, History

Floats = NDArray[np.float64]
LINES = np.array([20.0, 5.0])  # 1 / R of the lines to two neighbours [S]


def own(samples: int = 100, noise: float = 0.0) -> History:
    """A stable plant of three states under two neighbours' voltages, a load and a reference."""
    generator = np.random.default_rng(0)
    A = 0.3 * generator.standard_normal((3, 3))
    b, e = generator.standard_normal(3), generator.standard_normal(3)
    w = np.column_stack([generator.uniform(5.0, 9.0, samples), generator.uniform(47.0, 49.0, (samples, 2))])
    d = np.column_stack([np.zeros(samples), generator.uniform(47.0, 49.0, samples)])
    x = [generator.uniform(-1.0, 1.0, 3)]
    for said, applied in zip(w[:-1], d[:-1], strict=True):
        x.append(A @ x[-1] + b * (said[0] - LINES @ said[1:]) + e * applied[1])
    states = np.array(x) + noise * generator.standard_normal((samples, 3))
    return History((Experiment(np.empty((samples, 0)), states, states, None, d, w),), 0.01)


def test_the_predictor_is_held_against_unseen_samples() -> None:
    """Exact data: the figure is rounding and stands in the certificate; another plant at the end is refused."""
    made = local.design(own(), 2, {})
    assert made.accepted, made.verdict
    proof = made.certificate.proof
    assert proof is not None
    assert (proof.samples, proof.spare_columns) == (20, 79 - 7)
    assert (proof.worst_residual or 0.0) < 1e-11
    np.testing.assert_allclose(made.conductances, LINES, rtol=1e-9)
    one = own().experiments[0]
    x = one.x.copy()
    x[85:] *= 1.01
    changed = local.design(replace(own(), experiments=(replace(one, x=x),)), 2, {})
    assert not changed.accepted
    assert "not true on 20 unseen samples" in changed.verdict


def test_units_do_not_matter() -> None:
    """States, voltages, loads and references in other units, with noise too: the same decision, the rescaled gains."""
    by_x, by_d = np.array([1e-8, 1e3, 1e8]), np.array([1.0, 1e-5])
    by_w = np.array([1e6, 1e-4, 1e7])
    for noise in (0.0, 1e-3):
        one = own(noise=noise).experiments[0]
        other = replace(one, x=one.x * by_x, y=one.y * by_x, d=one.d * by_d, w=one.w * by_w)
        plain, scaled = (local.design(History((each,), 0.01), 2, {}) for each in (one, other))
        assert plain.accepted, plain.verdict
        assert scaled.accepted, scaled.verdict
        assert np.allclose(scaled.conductances / (by_w[0] / by_w[1:]), plain.conductances, rtol=1e-6)
        assert np.allclose(scaled.error * by_x / by_x[:, None], plain.error, atol=1e-6)
