"""Delayed observers that promise a bound: does the error stay within it while unknown inputs are as in the record?

The unknown input is measured by our own regression: what is left of X_f once [X_p; U_p; 1] is taken off, whitened; its
largest norm over the part that is not held back is 1.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from monitor.proof import hold_back
from tests.fuzz.judge import Outcome
from tests.fuzz.oracle import effective
from tests.fuzz.recordings import complete

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.observers import Design
    from tests.fuzz.plants import Plant
    from tests.fuzz.recordings import Recording

    Floats = NDArray[np.float64]

_STEPS = 200  # that are judged
_LEAST = 1e-10  # of the first error is left before that
_SLOWEST = 0.97  # of the error dynamics: 757 steps until then
_LEFT = 1.02  # what that may add to a bound


def bounded_outcome(
    plant: Plant, recording: Recording, made: Design, generator: np.random.Generator
) -> tuple[Outcome, str]:
    """Run past the first error with inputs like those of the record; hold errors and residuals against the bounds."""
    guarantee, observer = made.certificate.guarantee, made.observer
    assert guarantee is not None
    assert observer is not None
    if guarantee.decay >= 1.0:
        return Outcome.WRONG, f"unstable: {made.verdict}"
    if plant.radius > 0.999 or guarantee.decay > _SLOWEST or recording.quality in {"noise", "single"}:
        return Outcome.OPEN, f"bound not tried: {made.verdict}"
    settled = int(np.ceil(np.log(_LEAST) / np.log(max(guarantee.decay, 0.5))))
    steps = settled + _STEPS
    u = recording.known * generator.uniform(-1.0, 1.0, (steps, plant.sizes[1]))
    d = recording.mean + recording.size * np.sign(generator.uniform(-1.0, 1.0, (steps, plant.sizes[2])))
    y, x = plant.run(generator.uniform(-1.0, 1.0, len(plant.A)), u, d)
    units = recording.units
    size = _size_of_inputs(plant, recording, max(guarantee.delay, 1), (u, x))
    weights = np.ones(len(x[0])) if guarantee.weights is None else guarantee.weights
    state, worst, moved = observer.init((u[0] * units.u).tolist(), (y[0] * units.y).tolist()), 0.0, np.zeros(len(y[0]))
    for step in range(steps):
        state, output = observer.step(state, (u[step] * units.u).tolist(), (y[step] * units.y).tolist())
        if step >= settled:
            error = np.array(output.estimate, dtype=float) - x[step - observer.lag] * units.x
            worst = max(worst, float(np.linalg.norm(weights * error)))
            moved = np.maximum(moved, np.abs(np.array(output.residual, dtype=float)))
    bound = min(guarantee.bound, guarantee.response_bound) * size
    rounding = 1e-6 * float(np.linalg.norm(weights * np.max(np.abs(x), axis=0) * units.x))
    told = f"error {worst:.3g}, bound {bound:.3g} for inputs of size {size:.3g}: {made.verdict}"
    if worst > _LEFT * bound + rounding:
        return Outcome.WRONG, f"above its bound: {told}"
    limits = np.full(len(moved), np.inf) if guarantee.residual_bound is None else guarantee.residual_bound * size
    if np.any(moved > _LEFT * limits + 1e-6 * np.max(np.abs(y), axis=0) * units.y):
        return Outcome.WRONG, f"residual {moved} above its bound {limits}: {told}"
    return Outcome.RIGHT, told


def _size_of_inputs(plant: Plant, recording: Recording, overlap: int, run: tuple[Floats, Floats]) -> float:
    """Largest norm of the unknown input of a run (u, x), in units of the largest of the seen record."""
    pairs = []
    for one in hold_back(recording.history, overlap).seen.experiments:
        kept = complete(one.u, one.y, one.x)[:-1] & complete(one.u, one.y, one.x)[1:]
        u_, x_ = one.u / recording.units.u, one.x / recording.units.x
        pairs.append((np.hstack([x_[:-1], u_[:-1], np.ones((len(x_) - 1, 1))])[kept], x_[1:][kept]))
    u, x = run
    V, F = (np.vstack([pair[side] for pair in pairs]) for side in (0, 1))
    Theta = np.linalg.lstsq(V, F, rcond=None)[0]
    rank = int(np.linalg.matrix_rank(effective(plant)[0])) if plant.E.size else 0
    if not rank:
        return 0.0
    _, values, right = np.linalg.svd(F - V @ Theta, full_matrices=False)
    whiten = right[:rank].T / values[:rank]
    recorded = np.max(np.linalg.norm((F - V @ Theta) @ whiten, axis=1))
    fresh = x[1:] - np.hstack([x[:-1], u[:-1], np.ones((len(x) - 1, 1))]) @ Theta
    return float(np.max(np.linalg.norm(fresh @ whiten, axis=1)) / recorded)
