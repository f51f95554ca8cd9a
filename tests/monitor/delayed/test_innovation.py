"""The residual of delayed observers: what moves it, and by how much at most."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from monitor.delayed import Model, model_of
from monitor.delayed.decoupling import decouple
from monitor.delayed.innovation import moved_by_inputs, residual_rows
from monitor.delayed.model import window_of
from monitor.delayed.model_based import design_from_model

Floats = NDArray[np.float64]

# DGU 1 of Gallo et al. (2020), sampled at 10 ms (theory.md section 3).
A = np.array([[-0.28837, 0.10333, 5.39842], [-0.40767, -0.33421, 1.71161], [-0.00055, -0.00072, 0.95996]])
E = np.array([[-0.24792, 0.04004], [1.28837, 0.01188], [0.00179, 0.0098]])


def residuals(model: Model, options: dict[str, object], w: Floats, phi: Floats) -> Floats:
    """(steps, p, runs) from rest; w (steps, q, runs), phi (steps, p, 1 or runs) added to the output."""
    made = design_from_model(model, options, 0.01)
    assert made.observer is not None, made.verdict
    x, found = np.zeros((len(model.A), w.shape[2])), []
    state = made.observer.init((), tuple(np.zeros((len(model.C), w.shape[2]))))
    for unknown, false in zip(w, phi, strict=True):
        y = model.C @ x + model.D @ unknown + false
        state, output = made.observer.step(state, (), tuple(y))
        found.append(np.stack([np.broadcast_to(one, w.shape[2:]) for one in output.residual]))
        x = model.A @ x + model.B @ unknown
    return np.array(found)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10**6), delay=st.integers(1, 3), p=st.integers(2, 3))
def test_exact_gains_leave_a_residual_that_no_unknown_input_moves(seed: int, delay: int, p: int) -> None:
    """R Gamma = 0; the residual has p - m_d independent signals, none for as many unknown inputs as outputs."""
    generator = np.random.default_rng(seed)
    drawn = generator.standard_normal((3, 3))
    model = model_of(
        drawn * 0.8 / np.max(np.abs(np.linalg.eigvals(drawn))),
        generator.standard_normal((3, 2)),
        generator.standard_normal((p, 3)),
    )
    made = design_from_model(model, {"delay": delay, "goal": "exact"}, 0.01)
    assume(made.accepted)
    window = window_of(model, delay)
    R = residual_rows(window, p, decouple(model, window).N)
    assert np.linalg.norm(R @ window.Gamma) < 1e-9 * (1.0 + np.linalg.norm(R)) * np.linalg.norm(window.Gamma)
    report = made.certificate.residual
    assert report is not None
    assert report.residual_rank == p - 2
    assert report.blind == (p == 2)


@pytest.mark.parametrize(("outputs", "delay"), [(1, 0), (1, 1), (1, 2), (2, 0), (3, 0)])
def test_unknown_inputs_move_the_residual_up_to_its_bound_and_no_further(outputs: int, delay: int) -> None:
    """500 random runs stay below residual_bound; the input built from the impulse response comes within 1 % of it."""
    model, options = model_of(A, E, np.eye(3)[:outputs]), {"delay": delay, "goal": "bounded"}
    made = design_from_model(model, options, 0.01)
    assert made.guarantee is not None
    assert made.guarantee.residual_bound is not None
    assert made.L is not None
    bound = made.guarantee.residual_bound
    assert np.allclose(
        bound,
        moved_by_inputs(
            model, window_of(model, delay), made.L, np.eye(outputs, outputs * (delay + 1), k=outputs * delay)
        ),
    )
    angle = np.random.default_rng(outputs).uniform(0.0, 2.0 * np.pi, (60, 500))
    w = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    still = np.zeros((60, outputs, 1))
    assert np.all(np.max(np.abs(residuals(model, options, w, still)), axis=(0, 2)) <= bound)
    steps = 400
    impulses = np.zeros((steps, 2, 2))
    impulses[0] = np.eye(2)
    response = residuals(model, options, impulses, np.zeros((steps, outputs, 1)))[:, 0]  # of r_0, (steps, inputs)
    size = np.linalg.norm(response, axis=1, keepdims=True)
    worst = np.divide(response, size, out=np.zeros_like(response), where=size > 0.0)[::-1]
    reached = residuals(model, options, worst[:, :, None], np.zeros((steps, outputs, 1)))[-1, 0, 0]
    assert reached == pytest.approx(bound[0], rel=0.01)


def test_a_bias_beyond_the_certain_one_is_seen_whatever_the_inputs_do() -> None:
    """V only: a jump a little above certain_bias crosses residual_bound in every one of 200 runs."""
    model = model_of(A, E, np.eye(3)[:1])
    made = design_from_model(model, {"delay": 1}, 0.01)
    assert made.guarantee is not None
    assert made.guarantee.residual_bound is not None
    assert made.guarantee.certain_bias is not None
    angle = np.random.default_rng(3).uniform(0.0, 2.0 * np.pi, (60, 200))
    w = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    phi = np.zeros((60, 1, 1))
    phi[30:] = 1.01 * made.guarantee.certain_bias[0]
    moved = np.abs(residuals(model, {"delay": 1}, w, phi))[30:, 0]
    assert np.all(np.max(moved, axis=0) > made.guarantee.residual_bound[0])
    assert "may hide behind them" in made.verdict
