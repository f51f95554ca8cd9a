"""The reduced-order observer: permuted and redundant outputs, residual, blindness."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from monitor.detectors import build
from monitor.link_monitor import LinkMonitor
from monitor.observers import LinearObserver, design
from monitor.observers.reduced_order import split_states

if TYPE_CHECKING:
    from collections.abc import Callable

    from monitor.history import History
    from tests.monitor.conftest import Plant


def _estimates(observer: LinearObserver, y: np.ndarray) -> np.ndarray:
    state = observer.init((), tuple(y[0]))
    rows = []
    for sample in y:
        state, output = observer.step(state, (), tuple(sample))
        rows.append(np.array(output.estimate))
    return np.array(rows)


def test_columns_are_permuted_when_the_last_ones_do_not_serve() -> None:
    """C2 is taken from other columns of C when the last p are singular; else the paper's order is kept."""
    assert split_states(np.array([[1.0, 0.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0]])) == ([0, 1], [2, 3])
    free, fixed = split_states(np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]))
    assert (free, fixed) == ([2], [0, 1])


@pytest.mark.parametrize("number", range(1, 7))
def test_neighbour_that_sends_voltage_and_current_only(dgu: Callable[[int], Plant], number: int) -> None:
    """From V and I_t the integrator state v is estimated with order 1, or the design is refused for its zero."""
    plant = replace(dgu(number), C=np.eye(3)[:2])
    generator = np.random.default_rng(number)
    history = plant.history(generator, samples=30, mean=(11.0, 50.0))
    made = design("reduced_order", history, {"allow_blind": True})
    full = design("full_order", history, {"allow_blind": True, "strategy": "dual_lqr", "decay": 0.9999})
    assert made.accepted == full.accepted
    if not isinstance(made.observer, LinearObserver):
        assert "unstable zeros" in made.verdict
        return
    d = np.array([11.0, 50.0]) + generator.uniform(-5.0, 5.0, (400, 2))
    y, x = plant.run(np.array([40.0, 5.0, 8.0]), np.zeros((400, 0)), d)
    assert made.observer.order == 1
    assert np.allclose(_estimates(made.observer, y)[-1], x[-1], atol=1e-6)


def test_two_outputs_and_two_unknown_inputs_are_blind(dgu: Callable[[int], Plant]) -> None:
    """Any change of V and I_t is explained by some load and reference: refused unless asked for the estimate."""
    history = replace(dgu(1), C=np.eye(3)[:2]).history(np.random.default_rng(0), samples=30, mean=(11.0, 50.0))
    assert "blind: 2 unknown inputs explain every change of 2 outputs" in design("reduced_order", history, {}).verdict
    assert "BLIND" in design("reduced_order", history, {"allow_blind": True}).verdict


def test_partial_output_on_a_link(dgu: Callable[[int], Plant]) -> None:
    """A link that carries (V, I_t, not sent) gives the estimate of v; without residual and without alarm."""
    plant = replace(dgu(1), C=np.eye(3)[:2])
    history = plant.history(np.random.default_rng(0), samples=30, mean=(11.0, 50.0))
    made = design("reduced_order", history, {"allow_blind": True})
    monitor = LinkMonitor(made.observer, build("fixed", {}, 0.01), blind=True)
    y, x = plant.run(np.array([40.0, 5.0, 8.0]), np.zeros((60, 0)), np.tile([11.0, 50.0], (60, 1)))
    state = monitor.init()
    for sample in y:
        state, output = monitor.step(state, (*sample.tolist(), float("nan")), True)  # noqa: FBT003 - delivered
    assert np.allclose([float(one) for one in output.estimate], x[-1], atol=1e-6)
    assert np.isnan([float(one) for one in output.residual]).all()


@pytest.mark.parametrize("number", range(1, 7))
def test_complete_output_leaves_a_parity_check(dgu_history: Callable[..., History], number: int) -> None:
    """With C = I nothing is integrated, yet the one-step prediction error sees biases along the same direction."""
    reduced = design("reduced_order", dgu_history(number), {})
    full = design("full_order", dgu_history(number), {})
    assert reduced.certificate.dynamics is not None
    assert reduced.certificate.dynamics.order == 0
    assert reduced.certificate.residual is not None
    assert full.certificate.residual is not None
    assert reduced.certificate.residual.residual_rank == 1
    hidden = full.certificate.residual.invisible_bias
    # The full order shows the plane to the rounding of its own steady state, 1e-6 of the gain.
    assert np.max(np.abs(reduced.certificate.residual.dc_gain @ hidden)) < 1e-6


def test_redundant_outputs_are_used(dgu: Callable[[int], Plant]) -> None:
    """Sending V twice makes C rank deficient: the estimate stays right and the copy becomes a check."""
    plant = replace(dgu(1), C=np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]]))
    history = plant.history(np.random.default_rng(0), samples=30, mean=(11.0, 50.0))
    made = design("reduced_order", history, {})
    assert isinstance(made.observer, LinearObserver), made.verdict
    assert made.certificate.residual is not None
    assert made.certificate.residual.residual_rank == 1
    y, x = plant.run(np.array([40.0, 5.0, 8.0]), np.zeros((60, 0)), np.tile([11.0, 50.0], (60, 1)))
    assert np.allclose(_estimates(made.observer, y)[-1], x[-1], atol=1e-6)
