"""Distributed observers: conditions, construction, coupling, running nodes, what breaks them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from monitor.distributed import (
    Network,
    Regressors,
    derivatives,
    design,
    filtered,
    integral,
    linked,
    ring,
)
from monitor.distributed.baselines import (
    NodeModel,
    identification_based,
    jointly_identified,
    model_based,
    solution_of,
)
from monitor.distributed.solution import NodeSolution, solve_node
from monitor.errors import HistoryError, MonitorError
from monitor.history import Experiment, History

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
    """With noise 0.001 the right number comes from the gap; with 0.3 nothing is clear and the design is refused."""
    made = design(spring_data(np.random.default_rng(1), 0.001), ring(5), {})
    assert made.report.unknown_inputs == (1, 2, 1, 2, 2), made.verdict
    refused = design(spring_data(np.random.default_rng(1), 0.3), ring(5), {})
    assert "not clear" in refused.verdict


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


def test_a_mutual_network_needs_sampled_data() -> None:
    """The structure is defined for a sampling period only."""
    with pytest.raises(MonitorError, match="sampled data"):
        design(spring_data(np.random.default_rng(0)), ring(5), {"structure": "mutual"})
