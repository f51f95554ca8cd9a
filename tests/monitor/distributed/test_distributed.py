"""Distributed observers: conditions, construction, coupling, running nodes, what breaks them."""

from __future__ import annotations

import json
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from monitor.distributed import (
    DistributedDesign,
    Network,
    Regressors,
    derivatives,
    design,
    filtered,
    integral,
    linked,
    ring,
    sampled,
)
from monitor.distributed.baselines import (
    NodeModel,
    identification_based,
    jointly_identified,
    model_based,
    solution_of,
)
from monitor.distributed.gains import error_dynamics, lie_response, stability
from monitor.distributed.solution import NodeSolution, solve_node
from monitor.errors import HistoryError, MonitorError
from monitor.history import Experiment, History

if TYPE_CHECKING:
    from collections.abc import Sequence

    from monitor.linear import Vector

Floats = NDArray[np.float64]

# Two masses and two springs, state (x1, x1', x2, x2') (theory.md section 5).
A = np.array([[0, 1, 0, 0], [-2.5 / 1.1, 0, 1.0 / 1.1, 0], [0, 0, 0, 1], [1.0 / 0.9, 0, -1.0 / 0.9, 0]])
B = np.array([[0.0, 0.0], [1.0 / 1.1, 0.0], [0.0, 0.0], [0.0, 1.0 / 0.9]])
B_W = np.array([[0.0], [0.0], [0.0], [0.5]])
KNOWN = ((0,), (1,), (0,), (), (1,))
MEASURED = ((0, 3), (1, 3), (3, 2), (1, 3), (1, 3, 0))


def models() -> tuple[NodeModel, ...]:
    """The springs from every node's perspective."""
    return tuple(
        NodeModel(A=A, B=B[:, list(k)], Bbar=np.column_stack([np.delete(B, k, axis=1), B_W]), C=np.eye(4)[list(m)])
        for k, m in zip(KNOWN, MEASURED, strict=True)
    )


def spring_data(generator: np.random.Generator, noise: float = 0.0) -> list[Regressors]:
    """40 random states, inputs and disturbances for every node, with derivatives."""
    data = []
    for known, measured in zip(KNOWN, MEASURED, strict=True):
        x, v = generator.uniform(-1.0, 1.0, (40, 4)), generator.uniform(-1.0, 1.0, (40, 3))
        xdot = x @ A.T + v @ np.column_stack([B, B_W]).T
        x, xdot = (signal + noise * generator.standard_normal(signal.shape) for signal in (x, xdot))
        rows = list(measured)
        data.append(derivatives(v[:, list(known)], x[:, rows], x, xdot[:, rows], xdot))
    return data


def solved(data: Regressors, unknown_inputs: int | None = None) -> NodeSolution:
    """The solution of a node that has one."""
    found = solve_node(data, unknown_inputs)
    assert isinstance(found, NodeSolution), found
    return found


def test_exact_data_give_the_model_based_matrices() -> None:
    """H, F, E, L of every node, the coupling and the abscissa agree with Theorem 1 to 1e-8."""
    made = design(spring_data(np.random.default_rng(0)), ring(5), {})
    truth = model_based(models(), ring(5), {}, sampled=False)
    assert made.accepted, made.verdict
    assert made.report.unknown_inputs == (1, 2, 1, 2, 2)
    for one, two in zip(made.gains, truth.gains, strict=True):
        for name in ("E", "F", "L", "H", "C"):
            assert np.allclose(getattr(one, name), getattr(two, name), atol=1e-8), name
    assert made.report.stability == pytest.approx(truth.report.stability, abs=1e-8)


def test_oracles_of_the_page() -> None:
    """lambda_min(Lap_1) = .382, bound 2.223, chi = 2.446, abscissa -.522."""
    report = model_based(models(), ring(5), {}, sampled=False).report
    assert ring(5).grounded(0) == pytest.approx(0.382, abs=5e-4)
    assert report.chi_bound == pytest.approx(2.223, abs=5e-4)
    assert report.chi == pytest.approx(2.446, abs=5e-4)
    assert report.stability == pytest.approx(-0.522, abs=5e-4)
    assert report.leader == 0


def test_the_plain_pseudo_inverse_has_the_wrong_rank() -> None:
    """The trap: on 3 of 5 nodes the least-norm solution of (20) has rank T_y > r; ours has rank r and solves it too."""
    wrong = 0
    for one in spring_data(np.random.default_rng(0)):
        stacked = np.vstack([one.X, one.U, one.Ydot])
        plain = (one.Xdot @ np.linalg.pinv(stacked, rcond=1e-10))[:, -len(one.Ydot) :]
        ours = solved(one)
        wrong += int(np.linalg.matrix_rank(plain, tol=1e-9) > ours.unknown_inputs)
        assert np.linalg.matrix_rank(ours.T_y, tol=1e-9) == ours.unknown_inputs
        assert ours.misfit < 1e-12
    assert wrong == 3


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6), n=st.integers(2, 5), p=st.integers(1, 4), q=st.integers(0, 2), m=st.integers(0, 2))
def test_conditions_on_data_decide_as_those_on_the_model(seed: int, n: int, p: int, q: int, m: int) -> None:
    """(18) holds exactly when rank C Bbar = rank Bbar, and then the solution is the model-based one."""
    assume(p < n and q < n)
    generator = np.random.default_rng(seed)
    model = NodeModel(
        A=generator.standard_normal((n, n)),
        B=generator.standard_normal((n, m)),
        Bbar=generator.standard_normal((n, q)),
        C=np.eye(n)[np.sort(generator.choice(n, p, replace=False))],
    )
    if q and generator.integers(2):
        model.Bbar[:, 0] *= np.all(model.C == 0.0, axis=0)  # an input that acts on what is not measured only
    assume(q == 0 or np.linalg.matrix_rank(model.Bbar) == q)
    values = np.linalg.svd(model.C @ model.Bbar, compute_uv=False) if q else np.ones(1)
    assume(np.all((values < 1e-12) | (values > 1e-3)))
    x, u, w = (generator.standard_normal((60, columns)) for columns in (n, m, q))
    xdot = x @ model.A.T + u @ model.B.T + w @ model.Bbar.T
    found = solve_node(derivatives(u, x @ model.C.T, x, xdot @ model.C.T, xdot), None)
    truth = solution_of(model)
    assert isinstance(found, str) == isinstance(truth, str), (found, truth)
    if isinstance(found, str):
        assert "condition (18)" in found
        return
    assert isinstance(truth, NodeSolution)
    # Errors of 1e-13 grow with the inverse of the smallest singular value of C Bbar, 1e3.
    assert np.allclose(found.T_y, truth.T_y, atol=1e-7)
    assert np.allclose(found.T_x, truth.T_x, atol=1e-6)
    assert np.allclose(found.T_u, truth.T_u, atol=1e-6)


def test_a_disconnected_graph_is_refused() -> None:
    """Assumption 1: the verdict names the nodes that no path reaches."""
    made = design(spring_data(np.random.default_rng(0)), linked(5, [(0, 1), (1, 2), (3, 4)]), {})
    assert not made.accepted
    assert "assumption 1" in made.verdict
    assert "4, 5" in made.verdict


def test_a_missing_leader_is_refused_by_condition_19() -> None:
    """Nodes 2 to 5 cannot lead: without node 1, or with node 2 asked to, the verdict names (19) and the mode."""
    data = spring_data(np.random.default_rng(0))
    for made in (design(data[1:], ring(4), {}), design(data, ring(5), {"leader": 1})):
        assert not made.accepted
        assert "condition (19)" in made.verdict
        assert "s = " in made.verdict


def test_an_unmatched_disturbance_is_refused_by_condition_18() -> None:
    """Node 3 measuring positions only does not see the forces at once: rank C Bbar < rank Bbar."""
    data = spring_data(np.random.default_rng(0))
    data[2] = Regressors(U=data[2].U, Y=data[2].X[[0, 2]], Ydot=data[2].Xdot[[0, 2]], X=data[2].X, Xdot=data[2].Xdot)
    made = design(data, ring(5), {})
    assert not made.accepted
    assert "node 3: condition (18)" in made.verdict


def test_a_weak_coupling_is_refused_with_the_bound() -> None:
    """On springs with negative damping a chi below D (13) leaves the network unstable; the verdict names the bound."""
    unstable = [NodeModel(A=A + 0.3 * np.eye(4), B=one.B, Bbar=one.Bbar, C=one.C) for one in models()]
    made = model_based(unstable, ring(5), {"chi": 0.1}, sampled=False)
    assert not made.accepted
    assert "D (13) asks for chi >" in made.verdict
    assert model_based(unstable, ring(5), {}, sampled=False).accepted


def test_short_and_idle_data_are_refused() -> None:
    """Too few columns, or states that never move, are named with the node."""
    data = spring_data(np.random.default_rng(0))
    few = [
        Regressors(U=one.U[:, :4], Y=one.Y[:, :4], Ydot=one.Ydot[:, :4], X=one.X[:, :4], Xdot=one.Xdot[:, :4])
        for one in data
    ]
    assert "record longer" in design(few, ring(5), {}).verdict
    idle = [Regressors(U=one.U, Y=one.Y, Ydot=one.Ydot, X=0.0 * one.X, Xdot=one.Xdot) for one in data]
    assert "assumption 5" in design(idle, ring(5), {}).verdict


def test_noise_is_never_taken_for_unknown_inputs() -> None:
    """With noise 0.01 the right number comes from the gap; with 0.3 nothing is clear and the design is refused."""
    made = design(spring_data(np.random.default_rng(1), 0.01), ring(5), {})
    assert made.report.unknown_inputs == (1, 2, 1, 2, 2), made.verdict
    refused = design(spring_data(np.random.default_rng(1), 0.3), ring(5), {})
    assert "not clear" in refused.verdict


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
    with pytest.raises(MonitorError, match="sampled data"):
        design(spring_data(np.random.default_rng(0)), ring(5), {"structure": "mutual"})


def test_a_node_that_joins_keeps_what_it_is_told_where_it_cannot_see() -> None:
    """Its first estimate fits its own output exactly, and is the guess where no output tells otherwise."""
    made = tank_design()
    x, _ = tank_run(1, 5)
    guess = tuple(x[0] + np.array([0.5, -0.5, 1.0, -1.0]))
    y = tuple(x[0, near(0)])
    found = np.array(made.observers[0].output(made.observers[0].join(y, guess), y).estimate)
    assert np.allclose(found[near(0)], x[0, near(0)], atol=1e-12)
    assert np.allclose(found[far(0)], np.array(guess)[far(0)], atol=1e-12)


def test_misuse_raises() -> None:
    """Data that do not belong to the network, a directed graph and unknown options raise."""
    data = spring_data(np.random.default_rng(0))
    with pytest.raises(MonitorError, match="data of 5 nodes, expected 4"):
        design(data, ring(4), {})
    with pytest.raises(MonitorError, match="undirected"):
        Network(adjacency=np.array([[0.0, 1.0], [0.0, 0.0]]))
    with pytest.raises(MonitorError, match="gain"):
        design(data, ring(5), {"gain": 1.0})
    with pytest.raises(MonitorError, match="leader is 7"):
        design(data, ring(5), {"leader": 7})


def test_identification_needs_bbar_and_then_decouples_exactly() -> None:
    """Least squares absorb the disturbance as A + Bbar K; I - H C removes Bbar, so on exact data nothing is lost."""
    data = spring_data(np.random.default_rng(0))
    made = identification_based(data, models(), ring(5), {})
    truth = model_based(models(), ring(5), {}, sampled=False)
    for one, two in zip(made.gains, truth.gains, strict=True):
        assert np.allclose(one.E, two.E, atol=1e-9)


def test_one_identified_model_is_wrong_where_a_node_cannot_remove_what_others_do_not_know() -> None:
    """Nodes 2, 4, 5 remove both forces; node 1 and 3 know u1, remove the other one, and keep the error along u1."""
    data = spring_data(np.random.default_rng(0))
    made = jointly_identified(data, models(), KNOWN, ring(5), {})
    truth = model_based(models(), ring(5), {}, sampled=False)
    off = [np.linalg.norm((a.E + a.L @ a.C) - (b.E + b.L @ b.C)) for a, b in zip(made.gains, truth.gains, strict=True)]
    assert np.all(np.array(off)[[1, 3, 4]] < 1e-9)
    assert np.all(np.array(off)[[0, 2]] > 1e-2)


@pytest.mark.parametrize("form", ["integral", "filtered"])
def test_forms_without_derivatives_converge_with_the_period(form: str) -> None:
    """Halving the sampling period makes the error of H four times smaller: both forms are of second order."""
    truth = model_based(models(), ring(5), {}, sampled=False)
    errors = []
    for period in (0.1, 0.05):
        data = []
        for known, measured in zip(KNOWN, MEASURED, strict=True):
            x, v = _spring_run(round(40.0 / period), period, np.random.default_rng(3), round(0.2 / period))
            history = History((Experiment(v[:, list(known)], x[:, list(measured)], x),), period)
            data.append(integral(history, round(0.5 / period)) if form == "integral" else filtered(history, 0.3))
        made = design(data, ring(5), {"unknown_inputs": (1, 2, 1, 2, 2)})
        assert made.accepted, made.verdict
        errors.append(np.mean([np.linalg.norm(a.H - b.H) for a, b in zip(made.gains, truth.gains, strict=True)]))
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)
    assert errors[0] < 5e-3


def test_forms_refuse_records_that_are_too_short() -> None:
    """Stretches or filters longer than the experiment raise with what was found."""
    history = History((Experiment(np.ones((9, 1)), np.ones((9, 2)), np.ones((9, 4))),), 0.1)
    with pytest.raises(HistoryError, match="9 samples"):
        integral(history, 9)
    with pytest.raises(HistoryError, match="time constants"):
        filtered(history, 0.3)


def _spring_run(steps: int, period: float, generator: np.random.Generator, hold: int) -> tuple[Floats, Floats]:
    """States and held inputs (u1, u2, w), integrated exactly."""
    moved = _sampled_springs(period)
    inputs = np.repeat(generator.uniform(-1.0, 1.0, (steps // hold + 1, 3)), hold, axis=0)[:steps]
    x, rows = generator.uniform(-1.0, 1.0, 4), []
    for v in inputs:
        rows.append(x)
        x = moved @ np.concatenate([x, v])
    return np.array(rows), inputs


def _sampled_springs(period: float) -> Floats:
    """[A_d B_d] by the series of the matrix exponential."""
    generator = np.block([[A, B, B_W], [np.zeros((3, 7))]]) * period
    term, total = np.eye(7), np.eye(7)
    for order in range(1, 30):
        term = term @ generator / order
        total = total + term
    return np.asarray(total[:4])


# A sampled chain of four leaky tanks, each node at one tank and its neighbours; every inflow is unknown near it.
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
