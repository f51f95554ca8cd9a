"""T's full-order observer from data: equations, the blind trap, refusals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from bags.wire.convert import history_of, history_records
from dgu_sim import load_scenario, run_experiments
from monitor.errors import MonitorError
from monitor.history import History, data_matrices, single
from monitor.observers import LinearObserver, design

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from monitor.observers import Design
    from tests.monitor.conftest import Plant

DGUS = range(1, 7)


def _observer(made: Design) -> LinearObserver:
    assert isinstance(made.observer, LinearObserver), made.verdict
    return made.observer


def _residuals(observer: LinearObserver, received: np.ndarray) -> np.ndarray:
    state = observer.init((), tuple(received[0]))
    rows = []
    for y in received:
        state, output = observer.step(state, (), tuple(y))
        rows.append(output.residual)
    return np.array(rows)


@pytest.mark.parametrize("number", DGUS)
def test_solution_reproduces_the_history(dgu_history: Callable[..., History], number: int) -> None:
    """W S = X_f holds on the recorded data, and the certificate says so."""
    made = design("full_order", dgu_history(number), {})
    data = data_matrices(dgu_history(number))
    observer = _observer(made)
    # T (14) backwards: W_f = D, W_x = A, W_p = B - A D.
    fitted = (observer.B - observer.A @ observer.D) @ data.Y_p + observer.A @ data.X_p + observer.D @ data.Y_f
    assert np.allclose(fitted, data.X_f, rtol=0.0, atol=1e-9)
    assert made.certificate.dynamics is not None
    assert made.certificate.dynamics.kernel_residual < 1e-10


@pytest.mark.parametrize("number", DGUS)
def test_error_dies_out_under_arbitrary_unknown_inputs(
    dgu: Callable[[int], Plant], dgu_history: Callable[..., History], number: int
) -> None:
    """Whatever load and reference do, the estimate becomes the state and the residual zero."""
    observer = _observer(design("full_order", dgu_history(number), {}))
    generator = np.random.default_rng(7)
    d = generator.uniform(-40.0, 60.0, (60, 2))
    _, x = dgu(number).run(generator.uniform(-50.0, 50.0, 3), np.zeros((60, 0)), d)
    state = observer.init((), tuple(x[0] + 5.0))
    for y in x:
        state, output = observer.step(state, (), tuple(y))
    assert np.allclose(np.array([float(one) for one in output.estimate]), x[-1], rtol=0.0, atol=1e-9)
    assert np.allclose(np.array([float(one) for one in output.residual]), 0.0, atol=1e-9)


def test_first_estimate_is_the_first_output(dgu_history: Callable[..., History]) -> None:
    """With C = I the observer starts from what it receives."""
    observer = _observer(design("full_order", dgu_history(), {}))
    y = (47.0, 9.0, 11.0)
    _, output = observer.step(observer.init((), y), (), y)
    assert np.allclose(np.array([float(one) for one in output.estimate]), y, rtol=1e-12)


def _grid_history(path: Path, dgu: int, *overrides: str) -> History:
    scenario = load_scenario(path, overrides)
    return history_of(history_records(dgu, run_experiments(scenario, dgu)))


TRAPS = {
    "float32": ("history.precision=float32",),
    "noise": ("history.noise_std=1e-3",),
    "joint": ("history.plant=joint",),
    "joint, long": ("history.plant=joint", "history.samples=300"),
    "joint, noise": ("history.plant=joint", "history.noise_std=1e-3"),
}
KNOWLEDGE: tuple[dict[str, object], ...] = ({}, {"unknown_inputs": 2}, {"noise_std": 1e-3})


@pytest.mark.parametrize("trap", TRAPS)
@pytest.mark.parametrize("number", DGUS)
def test_blind_trap(scenario_path: Path, trap: str, number: int) -> None:
    """Rounded, noisy and jointly integrated histories: the residual moves under a bias, or the design is refused."""
    history = _grid_history(scenario_path, number, *TRAPS[trap])
    for options in KNOWLEDGE:
        made = design("full_order", history, options)
        if made.observer is None:
            assert made.verdict.startswith("refused: ")
            assert len(made.verdict) > len("refused: ")
            continue
        assert made.certificate.data is not None
        assert made.certificate.data.unknown_inputs == 2
        received = np.tile([47.0, 10.0, 11.0], (60, 1))
        quiet = _residuals(_observer(made), received)
        received[30:] += 0.1
        moved = np.abs(_residuals(_observer(made), received) - quiet)[30:]
        # The weakest of the six DGUs shows .03 of .1 without noise; a blind one would show rounding.
        assert moved.max() > 0.01


@pytest.mark.parametrize("number", DGUS)
def test_known_number_saves_every_trap(scenario_path: Path, number: int) -> None:
    """Told that there are two unknown inputs, every float32 and noisy history gives an observer that sees."""
    for trap in ("float32", "noise"):
        made = design("full_order", _grid_history(scenario_path, number, *TRAPS[trap]), {"unknown_inputs": 2})
        assert made.accepted, made.verdict


def test_plain_pseudo_inverse_would_be_blind(dgu_history: Callable[..., History]) -> None:
    """Told that everything is an unknown input, the design copies y: refused as blind, accepted only when asked."""
    history = dgu_history(1, noise_std=1e-3)
    made = design("full_order", history, {"unknown_inputs": 3})
    assert made.observer is None
    assert "blind: 3 unknown inputs explain every change of 3 outputs" in made.verdict
    allowed = design("full_order", history, {"unknown_inputs": 3, "allow_blind": True})
    assert allowed.accepted
    assert "BLIND" in allowed.verdict


def test_bad_history_is_a_refusal_in_words() -> None:
    """A history that cannot be used does not raise in the design: the monitor reports it."""
    x = np.random.default_rng(0).standard_normal((3, 3))
    made = design("full_order", single(np.zeros((3, 0)), x, x, 0.01), {})
    assert not made.accepted
    assert "record longer" in made.verdict


def test_unrelated_output_is_refused(dgu_history: Callable[..., History]) -> None:
    """An output recorded at other instants than x is noticed."""
    x = dgu_history().experiments[0].x
    made = design("full_order", single(np.zeros((20, 0)), np.roll(x, 7, axis=0), x, 0.01), {})
    assert "record y and x at the same instants, rows and columns alike" in made.verdict


def test_unknown_kind_and_option() -> None:
    """Misuse raises one line."""
    x = np.zeros((3, 3))
    with pytest.raises(MonitorError, match="observer kind is 'magic', expected one of"):
        design("magic", single(np.zeros((3, 0)), x, x, 0.01), {})
    with pytest.raises(MonitorError, match="full_order: option strategy = 'best': Input should be 'minimum_norm'"):
        design("full_order", single(np.zeros((3, 0)), x, x, 0.01), {"strategy": "best"})
