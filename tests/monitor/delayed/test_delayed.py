"""Delayed observers: window equations, exact decoupling, guaranteed bounds, the design from data alone."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from monitor.delayed import DelayedDesign, Model, design, model_of
from monitor.delayed.bounds import certify, respond
from monitor.delayed.model import Window, window_of
from monitor.delayed.model_based import design_from_model
from monitor.delayed.performance import optimise, solve_lmi
from monitor.delayed.realisation import realise
from monitor.detectors import build
from monitor.errors import MonitorError
from monitor.history import Experiment, History
from monitor.link_monitor import LinkMonitor

Floats = NDArray[np.float64]

# DGU 1 of Gallo et al. (2020), sampled at 10 ms (theory.md section 3).
A = np.array([[-0.28837, 0.10333, 5.39842], [-0.40767, -0.33421, 1.71161], [-0.00055, -0.00072, 0.95996]])
E = np.array([[-0.24792, 0.04004], [1.28837, 0.01188], [0.00179, 0.0098]])


def dgu(outputs: int) -> Model:
    """DGU 1 sending the first outputs of (V, I_t, v)."""
    return model_of(A, E, np.eye(3)[:outputs])


def orthogonal_history(model: Model, reach: float = 1.0) -> History:
    """Two-sample experiments from all corners of [x; w]: w is uncorrelated with x, |w| = reach sqrt(q)."""
    n, q = model.B.shape
    corners = np.array(np.meshgrid(*([[-1.0, 1.0]] * (n + q)))).reshape(n + q, -1).T
    experiments = []
    for corner in corners:
        start, w = corner[:n], reach * corner[n:]
        x = np.stack([start, model.A @ start + model.B @ w])
        experiments.append(Experiment(np.empty((2, 0)), x @ model.C.T, x))
    spare, generator = len(experiments) // 4, np.random.default_rng(0)
    for number in range(spare):  # one in five is held back: these, so that what is seen stays orthogonal
        run = [generator.uniform(-1.0, 1.0, n)]
        for w in generator.uniform(-reach, reach, (8, q)):
            run.append(model.A @ run[-1] + model.B @ w)
        rows = np.array(run)
        experiments.insert((2 * number + 1) * 5 // 2, Experiment(np.empty((9, 0)), rows @ model.C.T, rows))
    return History(tuple(experiments), 0.01, comparable=True)


def random_history(model: Model, generator: np.random.Generator, samples: int, mean: Floats) -> History:
    """One experiment with w = mean + U(-1, 1)^q."""
    rows = [generator.uniform(-1.0, 1.0, len(model.A))]
    for w in mean + generator.uniform(-1.0, 1.0, (samples - 1, len(mean))):
        rows.append(model.A @ rows[-1] + model.B @ w)
    x = np.array(rows)
    return History((Experiment(np.empty((samples, 0)), x @ model.C.T, x),), 0.01)


def run(made: DelayedDesign, model: Model, w: Floats, start: Floats) -> tuple[Floats, Floats, Floats]:
    """States (steps, n), estimates and reconstructed inputs, under w (steps, q); D included."""
    assert made.observer is not None, made.verdict
    assert made.input_observer is not None
    x, states, estimates, inputs = start, [], [], []
    first = tuple(model.C @ x + model.D @ w[0])
    state_memory, input_memory = made.observer.init((), first), made.input_observer.init((), first)
    for sample in w:
        y = tuple(model.C @ x + model.D @ sample)
        state_memory, found = made.observer.step(state_memory, (), y)
        input_memory, guessed = made.input_observer.step(input_memory, (), y)
        states.append(x)
        estimates.append(np.array(found.estimate))
        inputs.append(np.array(guessed.estimate))
        x = model.A @ x + model.B @ sample
    return np.array(states), np.array(estimates), np.array(inputs)


def random_model(generator: np.random.Generator, n: int, q: int, p: int) -> Model:
    """A random plant of spectral radius 0.8 with feedthrough and two known inputs."""
    dynamics = generator.standard_normal((n, n))
    return Model(
        A=dynamics * 0.8 / np.max(np.abs(np.linalg.eigvals(dynamics))),
        B=generator.standard_normal((n, q)),
        C=generator.standard_normal((p, n)),
        D=generator.standard_normal((p, q)),
        B_u=generator.standard_normal((n, 2)),
        D_u=generator.standard_normal((p, 2)),
    )


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6), delay=st.integers(0, 3), n=st.integers(1, 4))
def test_window_matrices_reproduce_every_trajectory(seed: int, delay: int, n: int) -> None:
    """Y = Theta x + Gamma W + Gamma_u U and x+ = A x + Phi W + B_u u hold for random trajectories, C (2) and (5)."""
    generator = np.random.default_rng(seed)
    model = random_model(generator, n, 2, 2)
    window = window_of(model, delay)
    w, u = generator.standard_normal((delay + 1, 2)), generator.standard_normal((delay + 1, 2))
    x = start = generator.standard_normal(n)
    outputs = []
    for unknown, known in zip(w, u, strict=True):
        outputs.append(model.C @ x + model.D @ unknown + model.D_u @ known)
        x = model.A @ x + model.B @ unknown + model.B_u @ known
    stacked = window.Theta @ start + window.Gamma @ w.ravel() + window.Gamma_u @ u.ravel()
    assert np.allclose(stacked, np.concatenate(outputs), atol=1e-9)
    following = model.A @ start + window.Phi @ w.ravel() + model.B_u @ u[0]
    assert np.allclose(following, model.A @ start + model.B @ w[0] + model.B_u @ u[0], atol=1e-12)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), delay=st.integers(0, 2))
def test_the_running_form_is_the_recursion_of_the_paper(seed: int, delay: int) -> None:
    """Stepping gives xhat_k+1 = Q xhat_k + L (Y - Gamma_u U) + B_u u_k and r = R (Y - Gamma_u U - Theta xhat_k)."""
    generator = np.random.default_rng(seed)
    model = random_model(generator, 3, 1, 2)
    window = window_of(model, delay)
    L = 0.1 * generator.standard_normal((3, 2 * (delay + 1)))
    R = generator.standard_normal((2, 2 * (delay + 1)))
    observer = realise(model, window, L, R)
    u, y = generator.standard_normal((12, 2)), generator.standard_normal((12, 2))
    state = observer.init(tuple(u[0]), tuple(y[0]))
    expected = np.array(state[:3])
    u_all, y_all = (np.vstack([np.tile(signal[0], (delay, 1)), signal]) for signal in (u, y))
    for step in range(12):
        before = expected
        Y, U = y_all[step : step + delay + 1].ravel(), u_all[step : step + delay + 1].ravel()
        expected = (model.A - L @ window.Theta) @ before + L @ (Y - window.Gamma_u @ U) + model.B_u @ u_all[step]
        state, found = observer.step(state, tuple(u[step]), tuple(y[step]))
        shown = expected if delay else before
        assert np.allclose(np.array(found.estimate), shown, atol=1e-10)
        innovation = Y - window.Gamma_u @ U - window.Theta @ before
        assert np.allclose(np.array(found.residual), R @ innovation, atol=1e-9)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), p=st.integers(2, 3), delay=st.integers(1, 3))
@example(seed=162, p=2, delay=2)  # a zero at 594: Gamma_2 and Gamma_3 look as if they had lost a rank
@example(seed=162, p=2, delay=3)
def test_exact_decoupling_is_decided_by_the_ranks_and_the_zeros(seed: int, p: int, delay: int) -> None:
    """L Gamma = Phi with Schur Q exists iff the ranks match and the zeros are stable; then both errors vanish."""
    generator = np.random.default_rng(seed)
    drawn = random_model(generator, 3, 2, p)
    model = model_of(drawn.A, drawn.B, drawn.C)
    made = design_from_model(model, {"delay": delay, "goal": "exact"}, 0.01)
    solvable = np.linalg.matrix_rank(model.C @ model.B) == 2  # then delay 1 is enough and more does no harm
    assert solvable  # random matrices are generic
    zeros = _zeros(model) if p == 2 else np.zeros(0)
    assume(np.all(np.abs(np.abs(zeros) - 1.0) > 0.02))
    assert made.accepted == bool(np.all(np.abs(zeros) < 1.0)), made.verdict
    if not made.accepted:
        assert "zero" in made.verdict
        return
    assert made.L is not None
    window = window_of(model, delay)
    assert np.linalg.norm(made.L @ window.Gamma - window.Phi) < 1e-8 * (1.0 + np.linalg.norm(made.L))
    assert made.certificate.dynamics is not None
    steps = 150
    assume(made.certificate.dynamics.spectral_radius < 0.85)
    w = 10.0 * generator.standard_normal((steps, 2))
    states, estimates, inputs = run(made, model, w, generator.standard_normal(3))
    lag = delay - 1
    # 0.85**140 = 1e-10 of a first error of order 1e2; zeros that are nearly unstable cost conditioning.
    assert np.max(np.abs(estimates[lag:] - states[: steps - lag])[140:]) < 1e-5
    assert np.max(np.abs(inputs[delay:] - w[: steps - delay])[140:]) < 1e-4


def _zeros(model: Model) -> NDArray[np.complex128]:
    """Invariant zeros of a square plant with D = 0: A restricted to ker C after feedback, here by B (C B)^-1 C A."""
    feedback = model.A - model.B @ np.linalg.solve(model.C @ model.B, model.C @ model.A)
    kernel = np.linalg.svd(model.C)[2][len(model.C) :].T
    return np.linalg.eigvals(kernel.T @ feedback @ kernel).astype(np.complex128)


@pytest.mark.parametrize(("outputs", "delay"), [(3, 0), (1, 0), (1, 1), (1, 2)])
def test_no_input_exceeds_the_bound_and_the_worst_comes_close(outputs: int, delay: int) -> None:
    """In 2000 random runs and 20 optimised ones |e| stays below the bound; optimised ones reach what is claimed."""
    model = dgu(outputs)
    made = design_from_model(model, {"delay": delay}, 0.01)
    assert made.guarantee is not None
    assert made.L is not None
    assert not made.guarantee.exact
    allowed = min(made.guarantee.bound, made.guarantee.response_bound)
    generator = np.random.default_rng(1)
    w = generator.standard_normal((40, 2, 2000))
    w /= np.linalg.norm(w, axis=1, keepdims=True)
    assert np.max(_errors(made, model, w)) <= allowed
    response = respond(model, window_of(model, delay), made.L, np.eye(3))
    worst = np.stack([response.worst(start)[1] for start in generator.standard_normal((20, 3))], axis=2)
    assert np.max(np.linalg.norm(worst, axis=1)) <= 1.0 + 1e-12
    reached = np.max(_errors(made, model, np.concatenate([worst, np.zeros((1, 2, 20))])))
    assert reached <= allowed * (1.0 + 1e-9)
    assert reached == pytest.approx(made.guarantee.reached, rel=1e-6)
    assert reached >= 0.95 * made.guarantee.response_bound  # the smaller of the two bounds, on this plant


def _errors(made: DelayedDesign, model: Model, w: Floats) -> Floats:
    """(steps, runs) |e| from rest; w (steps, q, runs)."""
    assert made.observer is not None
    assert made.guarantee is not None
    x = np.zeros((3, w.shape[2]))
    memory = made.observer.init((), tuple(model.C @ x))
    states, estimates = [], []
    for sample in w:
        memory, found = made.observer.step(memory, (), tuple(model.C @ x))
        states.append(x)
        estimates.append(np.array([np.broadcast_to(one, x.shape[1:]) for one in found.estimate]))
        x = model.A @ x + model.B @ sample
    lag = made.guarantee.lag
    misfit = np.array(estimates[lag:]) - np.array(states[: len(states) - lag])
    return np.asarray(np.linalg.norm(misfit, axis=1))


@pytest.mark.parametrize("seed", range(6))
def test_the_gain_is_the_optimum_of_the_lmi(seed: int) -> None:
    """C's semidefinite programme, solved as such, finds no smaller mu for the same a; nor any a a smaller one."""
    generator = np.random.default_rng(seed)
    model = dgu(1) if not seed else random_model(generator, 3, 2, 1)
    window = window_of(model, 1)
    found = optimise(model, window, np.eye(3))
    assert found is not None
    programme = _programme(model, window, found.a)
    assert found.mu <= programme * (1.0 + 1e-6)
    assert found.mu == pytest.approx(programme, rel=2e-3)  # the interior-point method ends short of the optimum
    mu, _ = certify(model, window, found.L, np.eye(3))
    assert mu <= found.mu * (1.0 + 1e-9)  # the best a of this very gain
    for a in (0.1, 0.3, 0.5, 0.7, 0.9):
        other = solve_lmi(model, window, np.eye(3), a)
        assert other is None or other.mu >= found.mu * (1.0 - 1e-9)


def _programme(model: Model, window: Window, a: float) -> float:
    """Smallest mu of C's LMI for one a, by an interior-point method."""
    cp: Any = import_module("cvxpy")
    n, q = len(model.A), window.Gamma.shape[1]
    P, Y = cp.Variable((n, n), symmetric=True), cp.Variable((n, len(window.Theta)))
    mu = cp.Variable()
    moved, pushed = P @ model.A - Y @ window.Theta, Y @ window.Gamma - P @ window.Phi
    zero = np.zeros((n, q))
    invariant = cp.bmat([[(1.0 - a) * P, zero, moved.T], [zero.T, a * np.eye(q), pushed.T], [moved, pushed, P]])
    seen = cp.bmat([[P, np.eye(n)], [np.eye(n), mu * np.eye(n)]])
    return float(cp.Problem(cp.Minimize(mu), [invariant >> 0, seen >> 0]).solve(solver=cp.CLARABEL))


def test_the_input_bound_holds_for_the_reconstructed_input() -> None:
    """Where exact decoupling is impossible, |w^ - w| stays below its guaranteed level in random runs."""
    model = dgu(1)
    made = design_from_model(model, {"delay": 2}, 0.01)
    assert made.guarantee is not None
    generator = np.random.default_rng(3)
    w = generator.standard_normal((300, 2))
    w /= np.linalg.norm(w, axis=1, keepdims=True)
    _, _, inputs = run(made, model, w, np.zeros(3))
    errors = np.linalg.norm(inputs[2:] - w[:-2], axis=1)
    assert np.max(errors) <= made.guarantee.input_bound
    assert np.max(errors) > 0.2 * made.guarantee.input_bound  # the bound is of the right size


def test_data_and_model_agree_on_an_orthogonal_experiment() -> None:
    """When w is exactly uncorrelated with x, Theta, Gamma and all bounds from data are those of the model."""
    model = dgu(1)
    history = orthogonal_history(model, reach=np.sqrt(0.5))  # |w| = 1 in every experiment
    for delay in (0, 1):
        from_data = design(history, {"delay": delay, "unknown_inputs": 2})
        truth = design_from_model(model, {"delay": delay}, 0.01)
        assert from_data.model is not None, from_data.verdict
        assert from_data.guarantee is not None
        assert truth.guarantee is not None
        assert np.allclose(from_data.model.A, model.A, atol=1e-9)
        assert np.allclose(from_data.model.B @ from_data.model.B.T, model.B @ model.B.T, atol=1e-9)
        assert from_data.guarantee.bound == pytest.approx(truth.guarantee.bound, rel=1e-3)  # two line searches
        assert from_data.guarantee.unit.startswith("the largest unknown input of the history")


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10**6), outputs=st.integers(2, 3))
def test_exact_gains_from_any_history_decouple_the_true_plant(seed: int, outputs: int) -> None:
    """From 20 correlated samples around an operating point: x_k+1 = Q x_k + L Y on every trajectory of the plant."""
    model = dgu(outputs)
    generator = np.random.default_rng(seed)
    made = design(random_history(model, generator, 20, np.array([11.0, 50.0])), {"delay": 1})
    assert made.guarantee is not None, made.verdict
    assert made.guarantee.exact
    assert ("BLIND" in made.verdict) == (outputs == 2)  # as many outputs as unknown inputs explain everything
    w = np.array([9.0, 47.0]) + generator.standard_normal((60, 2))
    states, estimates, _ = run(made, model, w, np.array([46.78, 9.0, 11.0]))
    # Exact in 0.37**50; the data equations hold to rounding of numbers of size 50 divided by the excitation.
    assert np.max(np.abs(estimates - states)[50:]) < 1e-5


def test_an_attack_is_reconstructed_exactly_whatever_the_coordinates() -> None:
    """One falsified output next to two unknown inputs: the attack vector comes out one step late, in its own units."""
    model = dgu(3)
    history = random_history(model, np.random.default_rng(2), 20, np.array([11.0, 50.0]))
    for channel in range(3):
        made = design(history, {"delay": 1, "attacked": (channel,), "attack_bound": 0.5, "goal": "exact"})
        attacked = Model(
            A=model.A,
            B=np.hstack([model.B, np.zeros((3, 1))]),
            C=model.C,
            D=np.hstack([np.zeros((3, 2)), np.eye(3)[:, [channel]]]),
            B_u=model.B_u,
            D_u=model.D_u,
        )
        phi = 0.1 * np.sin(np.arange(120.0)) * (np.arange(120) > 60)
        w = np.column_stack([np.random.default_rng(3).uniform((8.0, 46.0), (10.0, 48.0), (120, 2)), phi])
        _, _, inputs = run(made, attacked, w, np.array([46.78, 9.0, 11.0]))
        assert made.input_noise_gain is not None
        assert made.input_noise_gain.shape == (3, 3)
        assert np.allclose(0.5 * inputs[1:, 2][60:], phi[:-1][60:], atol=1e-6)


def test_a_zero_outside_the_unit_circle_makes_an_attack_irreconstructible() -> None:
    """For y+ = x+ with a falsified sensor whose zero is at 2, exact decoupling is refused and `best` falls back."""
    dynamics = np.array([[0.5, 1.0], [0.0, 2.0]])
    model = Model(
        A=dynamics,
        B=np.array([[1.0], [0.0]]),
        C=np.array([[1.0, 1.0]]),
        D=np.zeros((1, 1)),
        B_u=np.zeros((2, 0)),
        D_u=np.zeros((1, 0)),
    )
    refused = design_from_model(model, {"delay": 1, "goal": "exact"}, 0.01)
    assert not refused.accepted
    assert "zero of modulus >= 1" in refused.verdict
    graceful = design_from_model(model, {"delay": 1}, 0.01)
    assert graceful.guarantee is not None, graceful.verdict
    assert not graceful.guarantee.exact
    assert graceful.guarantee.bound > 0.0


def test_an_undetectable_plant_is_refused() -> None:
    """An unstable mode that no output shows: no gain, no bound, one line."""
    model = model_of(np.diag([1.5, 0.5]), np.array([[0.0], [1.0]]), np.array([[0.0, 1.0]]))
    made = design_from_model(model, {"goal": "bounded"}, 0.01)
    assert not made.accepted
    assert "not detectable" in made.verdict


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"delay": 0, "goal": "exact"}, "rank Gamma_delta - rank Gamma_delta-1 is 0, expected 2"),
        ({"attacked": (3,)}, "expected positions 0 to 2"),
        ({"weights": (1.0, 1.0)}, "2 weights for 3 states"),
    ],
)
def test_designs_that_cannot_be_are_refused_with_the_condition(options: dict[str, object], expected: str) -> None:
    """The verdict names what was found and what was expected."""
    history = random_history(dgu(3), np.random.default_rng(2), 20, np.array([11.0, 50.0]))
    made = design(history, options)
    assert not made.accepted
    assert expected in made.verdict


def test_bad_histories_are_refused_in_one_line() -> None:
    """A history that is too short, or in which y is no function of x, is refused with what would fix it."""
    model = dgu(3)
    short = random_history(model, np.random.default_rng(2), 4, np.array([11.0, 50.0]))
    assert "record longer" in design(short, {}).verdict
    whole = random_history(model, np.random.default_rng(2), 30, np.array([11.0, 50.0])).experiments[0]
    other = np.random.default_rng(3).standard_normal(whole.y.shape)
    assert "unexplained" in design(History((Experiment(whole.u, other, whole.x),), 0.01), {}).verdict


def test_misuse_raises() -> None:
    """Shapes that do not fit, unknown inputs that act alike, and unknown options are misuse."""
    with pytest.raises(MonitorError, match="D has shape"):
        model_of(A, E, np.eye(3), np.zeros((2, 2)))
    with pytest.raises(MonitorError, match=r"\[B; D\] has rank 1"):
        model_of(A, np.hstack([E[:, :1], 2.0 * E[:, :1]]), np.eye(3))
    with pytest.raises(MonitorError, match="lag"):
        design_from_model(dgu(3), {"lag": 1}, 0.01)


def test_floats_and_arrays_step_to_the_same_bits() -> None:
    """Runs in arrays are runs in floats, the constant input of the operating point of a bounded design included."""
    history = random_history(dgu(2), np.random.default_rng(2), 30, np.array([11.0, 50.0]))
    made = design(history, {"delay": 2, "unknown_inputs": 2, "goal": "bounded"})
    assert made.observer is not None, made.verdict
    y = np.random.default_rng(6).standard_normal((20, 2, 4))
    alone = []
    for number in range(4):
        state = made.observer.init((), tuple(float(one) for one in y[0, :, number]))
        for sample in y[:, :, number]:
            state, found = made.observer.step(state, (), tuple(float(one) for one in sample))
        alone.append(np.array(found.estimate))
    state = made.observer.init((), tuple(y[0]))
    for sample in y:
        state, found = made.observer.step(state, (), tuple(sample))
    assert np.array_equal(np.array(found.estimate).T, np.array(alone))


def test_it_runs_as_a_link_monitor_and_restarts_after_a_gap() -> None:
    """Under the one protocol: a missing sample makes the residual NaN, then the observer starts afresh and settles."""
    model = dgu(3)
    made = design(random_history(model, np.random.default_rng(2), 30, np.array([11.0, 50.0])), {"delay": 1}).as_design()
    assert made.accepted
    monitor = LinkMonitor(made.observer, build("fixed", {"settle_sec": 0.1, "calibrate_sec": 0.2}, 0.01))
    state, x, residuals = monitor.init(), np.array([46.78, 9.0, 11.0]), []
    generator = np.random.default_rng(5)
    for step in range(90):
        state, output = monitor.step(state, tuple(float(one) for one in x), delivered=step != 40)
        residuals.append([float(one) for one in output.residual])
        x = model.A @ x + model.B @ (np.array([9.0, 47.0]) + generator.uniform(-1.0, 1.0, 2))
    found = np.array(residuals)
    assert np.all(np.isnan(found[40]))
    assert np.all(np.isfinite(np.delete(found, 40, axis=0)))
    assert np.max(np.abs(found[[39, 89]])) < 1e-6
