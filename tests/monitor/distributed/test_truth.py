"""A distributed design in other units, and on columns that it has not seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from monitor.distributed import DistributedDesign, Regressors, derivatives, design, linked, ring
from monitor.distributed.gains import leader_gain
from monitor.distributed.solution import solve_node, undetectable

Floats = NDArray[np.float64]
NODES, N = 4, 4


def data_of(seed: int, *, sampled: bool, noise: float = 0.0) -> list[Regressors]:
    """Four nodes that measure three of four mixed states; each knows one of three inputs."""
    generator = np.random.default_rng(seed)
    A, B = 0.2 * generator.standard_normal((N, N)) - (0.0 if sampled else 1.0) * np.eye(N), np.eye(N)[:, :2]
    found = []
    for node in range(NODES):
        C = generator.standard_normal((3, N))
        x, v = generator.uniform(-1.0, 1.0, (60, N)), generator.uniform(-1.0, 1.0, (60, 2))
        dot = x @ A.T + v @ B.T + noise * generator.standard_normal((60, N))
        one = derivatives(v[:, [node % 2]], x @ C.T, x, dot @ C.T, dot)
        found.append(replace(one, sampled=sampled, comparable=False))
    return found


def accepted(data: list[Regressors], **options: object) -> DistributedDesign:
    """The design of a ring, which must exist."""
    made = design(data, ring(NODES), options)
    assert made.accepted, made.verdict
    return made


@pytest.mark.parametrize("sampled", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_units_do_not_matter(seed: int, sampled: bool) -> None:  # noqa: FBT001 - parametrised
    """Every signal in other units, 1e-8 to 1e8: the same decision, coupling and radius, the gains in those units."""
    data, generator = data_of(seed, sampled=sampled), np.random.default_rng(seed)
    x, u, y = (10.0 ** generator.uniform(-8.0, 8.0, size) for size in (N, (NODES, 1), (NODES, 3)))
    other = [one.in_units(1.0 / u[node], 1.0 / y[node], 1.0 / x) for node, one in enumerate(data)]
    plain, scaled = accepted(data), accepted(other)
    assert scaled.report.unknown_inputs == plain.report.unknown_inputs == (1,) * NODES
    assert scaled.report.chi == pytest.approx(plain.report.chi, rel=1e-6)
    assert scaled.report.stability == pytest.approx(plain.report.stability, abs=1e-6)
    for node, (one, two) in enumerate(zip(plain.gains, scaled.gains, strict=True)):
        assert np.allclose(two.E * x / x[:, None], one.E, atol=1e-6 * np.max(np.abs(one.E)))
        assert np.allclose(two.L * y[node] / x[:, None], one.L, atol=1e-6 * np.max(np.abs(one.L)))


@pytest.mark.parametrize("sampled", [False, True])
def test_unseen_columns_are_counted_and_judged(sampled: bool) -> None:  # noqa: FBT001 - parametrised
    """Exact data: the figure is rounding. Another plant in the columns that are held back: refused with the figure."""
    data = data_of(1, sampled=sampled)
    report = accepted(data).report
    assert report.unseen == (12,) * NODES
    assert max(report.unseen_error) < 1e-12
    assert report.spare_columns == (48 - N - 2,) * NODES
    dot = data[2].Xdot.copy()
    dot[0, 50:] += 1e-3 * data[2].X[1, 50:]
    made = design([*data[:2], replace(data[2], Xdot=dot), data[3]], ring(NODES), {})
    assert not made.accepted
    assert made.verdict.startswith("refused: node 3: not true on 12 unseen samples")


def test_noise_is_allowed_for_what_it_is() -> None:
    """Data with noise are held against their own noise, and the figure in the verdict is of its size."""
    made = accepted(data_of(2, sampled=True, noise=1e-3), unknown_inputs=[1] * NODES)
    assert 1e-4 < max(made.report.unseen_error) < 0.1
    assert "unseen columns" in made.verdict


def test_too_few_columns_are_refused_with_how_many_it_takes() -> None:
    """What is left beside the held-back columns must exceed what anything fits."""
    data = [one.part(0, 9) for one in data_of(3, sampled=True)]
    assert "7 columns, expected at least 8" in design(data, ring(NODES), {}).verdict


def watched(seed: int, *, sampled: bool, noise: float, states: int = 4, unknown: int = 2) -> Regressors:
    """A node with as many outputs as unknown inputs: C (I - H C) = 0, so that noise alone shows ker C to it."""
    generator = np.random.default_rng(seed)
    A = 0.2 * generator.standard_normal((states, states)) - (0.0 if sampled else 1.0) * np.eye(states)
    B, C = (generator.standard_normal(shape) for shape in ((states, unknown), (unknown, states)))
    x, d = generator.uniform(-1.0, 1.0, (60, states)), generator.uniform(-1.0, 1.0, (60, unknown))
    dot = x @ A.T + d @ B.T
    X, Xdot, Y, Ydot = (
        table + noise * generator.standard_normal(table.shape) for table in (x, dot, x @ C.T, dot @ C.T)
    )
    return replace(derivatives(np.zeros((60, 0)), Y, X, Ydot, Xdot), sampled=sampled, comparable=False)


@pytest.mark.parametrize("sampled", [False, True])
@pytest.mark.parametrize("noise", [1e-7, 1e-5, 1e-3])
def test_a_leader_amplifies_no_noise(sampled: bool, noise: float) -> None:  # noqa: FBT001 - parametrised
    """What only noise makes observable gets no gain: refused as undetectable, or led with a gain of ordinary size."""
    for seed in range(12):
        found = solve_node(watched(seed, sampled=sampled, noise=noise), 2)
        if isinstance(found, str) or len(undetectable(found, sampled=sampled)):
            continue
        gain = leader_gain(found, sampled=sampled)
        assert gain is not None
        assert np.linalg.norm(gain, 2) < 1e2 * (1.0 + np.linalg.norm(found.T_x, 2))


@pytest.mark.parametrize("seed", range(6))
def test_exact_records_tell_a_node_whose_states_are_all_moved(seed: int) -> None:
    """As many unknown inputs as states, one of them a thousandth: another node's record shows that it is no noise."""
    generator = np.random.default_rng(seed)
    A, B = generator.standard_normal((2, 2)) - 2.0 * np.eye(2), np.diag([1.0, 10.0 ** generator.uniform(-3.0, -1.0)])
    x, u = generator.uniform(-1.0, 1.0, (40, 2)), generator.uniform(-1.0, 1.0, (40, 2))
    dot = x @ A.T + u @ B.T
    data = [derivatives(known, x, x, dot, dot) for known in (u[:, :1], u[:, :0])]
    made = design(data, linked(2, [(0, 1)]), {})
    assert made.report.unknown_inputs == (1, 2), made.verdict
    assert max(made.report.unseen_error) < 1e-9
