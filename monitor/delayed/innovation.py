"""What a delayed observer is judged by: how the outputs of the window differ from what its estimate predicts.

nu = Y_k:k+delta - Gamma_u U - Theta xhat_k = Gamma W - Theta e_k, plus whatever is falsified. The residual is R nu:

- gains that cancel the unknown inputs leave e = 0, so R is taken from the left null space N of Gamma: R = F' N', with
  N' its rows that look at the newest sample, scaled so that their part F on it is orthonormal. Nothing but a
  falsification moves this residual. With as many unknown inputs as outputs there is no such row: R = 0, blind.
- otherwise nothing is free of the unknown inputs, and R picks the newest block: the prediction error of y_t from
  samples up to t - 1. Unknown inputs move it too, but not beyond `moved_by_inputs`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from monitor.delayed.bounds import respond

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.delayed.model import Model, Window

_SEEN = 1e-6  # a row of the null space whose part on the newest sample is smaller does not look at it


def residual_rows(window: Window, outputs: int, null: NDArray[np.float64] | None) -> NDArray[np.float64]:
    """R (p, (delta + 1) p); `null`: rows N of the left null space for an exact gain, None for another."""
    newest = np.eye(outputs, len(window.Gamma), k=len(window.Gamma) - outputs)
    if null is None:
        return newest
    looking, sizes, F = np.linalg.svd(null @ newest.T, full_matrices=False)
    kept = sizes > _SEEN
    return np.asarray(F[kept].T @ ((looking[:, kept] / sizes[kept]).T @ null))


def moved_by_inputs(
    model: Model, window: Window, L: NDArray[np.float64], R: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Largest |r_i| / sup |w| in the limit without any attack, (p,): sum_l |row i of the response to w_t-l|."""
    errors = respond(model, window, L, np.eye(len(model.A)))
    if not errors.ended:
        return np.full(len(R), np.inf)
    through_error = -R @ window.Theta @ errors.G  # from w_t-1, w_t-2, …
    direct = np.stack(np.split(R @ window.Gamma, window.delay + 1, axis=1)[::-1])  # from w_t, w_t-1, … w_t-delta
    response = np.zeros((max(len(through_error) + 1, len(direct)), len(R), model.B.shape[1]))
    response[1 : len(through_error) + 1] += through_error
    response[: len(direct)] += direct
    return np.asarray(np.linalg.norm(response, axis=2).sum(axis=0))
