"""Nodes that share a sampled plant: a chain of tanks, of which each node measures its part."""

from __future__ import annotations

import json
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pytest
from numpy.typing import NDArray

from monitor.distributed import (
    DistributedDesign,
    design,
    linked,
    sampled,
)
from monitor.distributed.gains import error_dynamics, lie_response, stability
from monitor.errors import MonitorError
from monitor.history import Experiment, History

if TYPE_CHECKING:
    from collections.abc import Sequence

    from monitor.linear import Vector

Floats = NDArray[np.float64]


TANKS = np.array([[0.8, 0.1, 0, 0], [0.1, 0.75, 0.1, 0], [0, 0.1, 0.75, 0.1], [0, 0, 0.1, 0.85]])
CHAIN = linked(4, [(0, 1), (1, 2), (2, 3)])


def near(node: int) -> list[int]:
    """Tanks that a node measures."""
    return sorted((node, *CHAIN.neighbours(node)))


def far(node: int) -> list[int]:
    """Tanks whose inflow is announced to it."""
    return [tank for tank in range(4) if tank not in near(node)]


def tank_design(options: dict[str, object] | None = None) -> DistributedDesign:
    """Sampled design from 40 samples of the whole chain."""
    generator = np.random.default_rng(0)
    w, x = generator.uniform(0.0, 2.0, (40, 4)), [np.ones(4)]
    for inflow in w[:-1]:
        x.append(TANKS @ x[-1] + inflow)
    data = [sampled(History((Experiment(w[:, far(i)], np.array(x)[:, near(i)], np.array(x)),), 0.1)) for i in range(4)]
    return design(data, CHAIN, options or {})


def exchange(
    made: DistributedDesign, x: Floats, w: Floats, lie: Floats | None = None, silent: Sequence[int] = ()
) -> Floats:
    """Estimates (steps, nodes, n[, runs]) of all nodes; node 1 may lie, some may be silent from the start."""
    states: list[Vector] = [one.init(tuple(x[0, near(node)])) for node, one in enumerate(made.observers)]
    rows = []
    for truth, inflow in zip(x, w, strict=True):
        outputs = [tuple(truth[near(node)]) for node in range(4)]
        found = [one.output(state, y).estimate for one, state, y in zip(made.observers, states, outputs, strict=True)]
        rows.append(np.array([[np.asarray(value) for value in one] for one in found]))
        sent: list[Vector] = list(found)
        if lie is not None:
            sent[1] = tuple(value + wrong for value, wrong in zip(found[1], lie, strict=True))
        states = [
            one.step(
                states[node],
                tuple(inflow[far(node)]),
                outputs[node],
                found[node],
                [(sent[other], other not in silent) for other in one.neighbours],
            )
            for node, one in enumerate(made.observers)
        ]
    return np.array(rows)


def tank_run(steps: int, seed: int, runs: tuple[int, ...] = ()) -> tuple[Floats, Floats]:
    """States and inflows of the chain, (steps, 4[, runs])."""
    generator = np.random.default_rng(seed)
    w, x = generator.uniform(-5.0, 5.0, (steps, 4, *runs)), [generator.uniform(-5.0, 5.0, (4, *runs))]
    for inflow in w[:-1]:
        x.append(np.tensordot(TANKS, x[-1], 1) + inflow)
    return np.array(x), w


def test_a_sampled_network_converges_as_fast_as_its_spectral_radius_says() -> None:
    """All nodes' errors go to zero under unknown inflows, and e+ = M e holds for the whole network at every step."""
    made = tank_design()
    assert made.accepted, made.verdict
    x, w = tank_run(120, 1)
    errors = exchange(made, x, w) - x[:, None, :]
    M = error_dynamics(made.gains, CHAIN)
    for before, after in pairwise(errors[:21]):
        assert np.allclose(M @ before.ravel(), after.ravel(), atol=1e-9)
    assert made.report.stability is not None
    assert made.report.stability < 0.92
    # 0.92**119 = 5e-5 of errors of order 10.
    assert np.max(np.abs(errors[-1])) < 1e-2
    assert json.loads(made.report.to_json())["nodes"] == 4


def test_runs_in_arrays_are_runs_in_floats() -> None:
    """Three runs as arrays give the bits of each alone, presence flags included."""
    made = tank_design()
    x, w = tank_run(30, 2, (3,))
    together = exchange(made, x, w, silent=(2,))
    for number in range(3):
        alone = exchange(made, x[:, :, number], w[:, :, number], silent=(2,))
        assert np.array_equal(together[..., number], alone)


def test_a_lie_does_exactly_the_computed_harm() -> None:
    """A constant bias on what node 2 sends moves every node to the computed steady error, and no further."""
    made = tank_design()
    lie = np.array([1.0, 0.0, 0.0, -2.0])
    x, w = tank_run(400, 3)
    errors = (exchange(made, x, w, lie) - x[:, None, :])[-1]
    assert np.allclose(errors, lie_response(made.gains, CHAIN, 1, lie, sampled=True), atol=1e-8)
    assert np.max(np.abs(errors)) > 1e-4  # it does some harm


def test_departures_are_told_beforehand() -> None:
    """With a node silent from the start the others converge at the radius in the report."""
    made = tank_design()
    x, w = tank_run(200, 4)
    errors = exchange(made, x, w, silent=(2,)) - x[:, None, :]
    rest = np.max(np.abs(np.delete(errors, 2, axis=1)), axis=(1, 2))
    radius = made.report.departures[2]
    assert radius < 0.92
    # The bound allows for a transient factor of 1e3 (non-normal dynamics) on errors of order 10.
    assert rest[150] < 1e4 * radius**150 + 1e-12


def test_a_coupling_that_overshoots_is_refused() -> None:
    """A sampled network has an upper limit on chi that (13) does not know."""
    made = tank_design({"chi": 3.0})
    assert not made.accepted
    assert "spectral radius" in made.verdict


def test_missing_samples_drop_their_pairs() -> None:
    """A NaN in a record costs the two pairs that hold it and changes nothing else."""
    generator = np.random.default_rng(0)
    x = generator.standard_normal((20, 3))
    x[7, 1] = np.nan
    data = sampled(History((Experiment(np.empty((20, 0)), x[:, :2], x),), 0.1))
    assert data.columns == 17
    assert np.isfinite(data.X).all()


def test_a_mutual_network_is_faster_than_one_with_a_leader() -> None:
    """When every node corrects itself and listens, errors shrink faster than behind a leader or without listening."""
    mutual, led = tank_design({"structure": "mutual"}), tank_design()
    assert mutual.accepted, mutual.verdict
    assert mutual.report.leader is None
    assert mutual.report.stability is not None
    assert led.report.stability is not None
    alone = [stability(one.E, sampled=True) for one in mutual.gains]
    assert mutual.report.stability < min(max(alone), led.report.stability)
    x, w = tank_run(120, 1)
    errors = exchange(mutual, x, w) - x[:, None, :]
    M = error_dynamics(mutual.gains, CHAIN)
    for before, after in pairwise(errors[:21]):
        assert np.allclose(M @ before.ravel(), after.ravel(), atol=1e-9)
    with pytest.raises(MonitorError, match="no leader"):
        tank_design({"structure": "mutual", "leader": 1})


def test_a_node_that_joins_keeps_what_it_is_told_where_it_cannot_see() -> None:
    """Its first estimate fits its own output exactly, and is the guess where no output tells otherwise."""
    made = tank_design()
    x, _ = tank_run(1, 5)
    guess = tuple(x[0] + np.array([0.5, -0.5, 1.0, -1.0]))
    y = tuple(x[0, near(0)])
    found = np.array(made.observers[0].output(made.observers[0].join(y, guess), y).estimate)
    assert np.allclose(found[near(0)], x[0, near(0)], atol=1e-12)
    assert np.allclose(found[far(0)], np.array(guess)[far(0)], atol=1e-12)
