"""How large errors of delayed observers become in simulation, against what is guaranteed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from monitor.delayed import ConstantInput
from monitor.delayed.bounds import ErrorResponse, respond, respond_input
from monitor.delayed.model import window_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.delayed import DelayedDesign, Model
    from monitor.linear import Vector
    from monitor.observers import Observer

RANDOM_RUNS, RANDOM_STEPS, ADVERSARIAL_RUNS = 10_000, 50, 100
REST = 5  # samples after an optimised sequence: a delayed error shows later than its input


@dataclass(frozen=True, slots=True, kw_only=True)
class Stress:
    """Largest |H e| / sup |w| met in simulation, against what is guaranteed.

    Attributes:
        random: over 10^4 random input sequences.
        adversarial: over 100 optimised ones.
        trajectory: (steps,) |H e| under the worst of them.
        inputs: largest |w^ - w| / sup |w| of the reconstructed input, over 1000 random and 100 optimised sequences.
    """

    random: float
    adversarial: float
    trajectory: NDArray[np.float64]
    inputs: float


def stress_of(made: DelayedDesign, model: Model, generator: np.random.Generator) -> Stress:
    """Run plant and observer from rest under random and optimised inputs with |w| <= 1."""
    if made.guarantee is None or made.L is None:
        raise TypeError(made.verdict)
    angle = generator.uniform(0.0, 2.0 * np.pi, (RANDOM_STEPS, RANDOM_RUNS))
    angle[:, ::2] = np.round(angle[:, ::2] * 2.0 / np.pi) * np.pi / 2.0  # half of them jump between four corners
    drawn = np.stack([np.cos(angle), np.sin(angle)])
    random = float(np.max(_errors(made, model, drawn)))
    window = window_of(model, made.guarantee.delay)
    errors = _errors(made, model, _worst(respond(model, window, made.L, np.eye(3)), generator))
    run_index = int(np.argmax(np.max(errors, axis=0)))
    against = _worst(respond_input(model, window, made.L), generator)
    inputs = max(_input_error(made, model, w) for w in (drawn[:, :, ::10], against))
    return Stress(random=random, adversarial=float(np.max(errors)), trajectory=errors[:, run_index], inputs=inputs)


def _worst(response: ErrorResponse, generator: np.random.Generator) -> NDArray[np.float64]:
    """Optimised sequences (2, steps, runs), with what it takes for the last input to show."""
    starts = generator.standard_normal((ADVERSARIAL_RUNS, response.G.shape[1]))
    found = np.stack([response.worst(start)[1] for start in starts], axis=2).transpose(1, 0, 2)
    return np.concatenate([found, np.zeros((2, REST, ADVERSARIAL_RUNS))], axis=1)


def _errors(made: DelayedDesign, model: Model, w: NDArray[np.float64]) -> NDArray[np.float64]:
    """(steps, runs) |e| of runs that start at rest; w (2, steps, runs)."""
    if made.observer is None:
        raise TypeError(made.verdict)
    states, estimates = _simulated(made.observer, model, w)
    lag = made.observer.lag
    return np.asarray(np.linalg.norm(estimates[lag:] - states[: len(states) - lag], axis=1))


def _input_error(made: DelayedDesign, model: Model, w: NDArray[np.float64]) -> float:
    """Largest |w^ - w| of runs that start at rest."""
    if made.input_observer is None:
        raise TypeError(made.verdict)
    _, estimates = _simulated(made.input_observer, model, w)
    lag = made.input_observer.lag
    true = w.transpose(1, 0, 2)
    return float(np.max(np.linalg.norm(estimates[lag:] - true[: len(true) - lag], axis=1)))


def _simulated(
    observer: Observer, model: Model, w: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """States and estimates (steps, n, runs) from rest, where the observer starts without error."""
    x, known = np.zeros((3, w.shape[2])), np.zeros((3, 1))
    if isinstance(observer, ConstantInput):
        known = model.B_u[:, :1]  # the operating point
        x = x + np.linalg.solve(np.eye(3) - model.A, known)
    states, estimates = [], []
    started = observer.init((), tuple(model.C @ x))
    memory: Vector = (*x, *started[3:])  # without a first error, which the bounds in the limit do not count
    for step in range(w.shape[1]):
        memory, output = observer.step(memory, (), tuple(model.C @ x))
        states.append(x)
        estimates.append(np.stack([np.broadcast_to(one, x.shape[1:]) for one in output.estimate]))
        x = model.A @ x + model.B @ w[:, step] + known
    return np.array(states), np.array(estimates)
