"""Plain regression x_t+1 = Theta v_t on recorded data in which every regressor is known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from monitor.errors import HistoryError
from monitor.rank import PEAK

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from monitor.history import History

_RANK = 1e-8  # relative, rows centred and scaled: below it a regressor follows from the others


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """A regression and how good it is.

    Attributes:
        Theta: (n, k) the coefficients.
        columns: N, pairs of consecutive samples used.
        misfit: |X_f - Theta V| / |X_f|.
        excitation: (k,) singular values of the regressors per sample, rows scaled to unit root mean square.
        error: (n, k) standard errors of the coefficients.
        doubt: standard error, in shares of the spread of each x, of what follows from a motion of the regressors by
            their root mean square along the direction that the history excites least; the largest of the n.
    """

    Theta: NDArray[np.float64]
    columns: int
    misfit: float
    excitation: NDArray[np.float64]
    error: NDArray[np.float64]
    doubt: float


def regress_states(history: History, tables: Sequence[tuple[NDArray[np.float64], ...]], names: Sequence[str]) -> Fit:
    """Fit x_t+1 = Theta [x_t; extra_t] over all experiments.

    Args:
        history: the experiments.
        tables: the extra regressors of each experiment, each (T, columns).
        names: what to call the regressors [x; extra] in messages.

    Raises:
        HistoryError: too few samples, or regressors that follow from one another.
    """
    before, after = [], []
    for experiment, extra in zip(history.experiments, tables, strict=True):
        rows = np.hstack([experiment.x, *extra])
        before.append(rows[:-1])
        after.append(experiment.x[1:])
    V, X_f = np.vstack(before).T, np.vstack(after).T
    whole = np.isfinite(V).all(axis=0) & np.isfinite(X_f).all(axis=0)
    V, X_f = V[:, whole], X_f[:, whole]
    k, columns = V.shape
    if columns <= k:
        raise HistoryError(f"{columns} pairs of consecutive samples for {k} regressors, expected more: record longer")
    scale = np.sqrt(np.mean(V**2, axis=1))
    for name, size, spread in zip(names, scale, np.ptp(V, axis=1), strict=True):
        if size == 0.0 or spread == 0.0:
            raise HistoryError(f"{name} never changes in the history: excite it")
    scaled = V / scale[:, None]
    excitation = np.asarray(np.linalg.svd(scaled, compute_uv=False) / np.sqrt(columns))
    if excitation[-1] <= _RANK * excitation[0]:
        raise HistoryError(f"{', '.join(names)} follow from one another in the history: excite each on its own")
    Theta = (X_f @ np.linalg.pinv(scaled)) / scale
    rest = X_f - Theta @ V
    variance = np.sum(rest**2, axis=1) / max(columns - k, 1)
    spread = np.diag(np.linalg.inv(scaled @ scaled.T)) / scale**2
    level = np.maximum(np.sqrt(variance), np.max(np.abs(rest), axis=1) / PEAK) / np.std(X_f, axis=1)
    return Fit(
        Theta=Theta,
        columns=columns,
        misfit=float(np.linalg.norm(rest) / np.linalg.norm(X_f)),
        excitation=excitation,
        error=np.sqrt(np.outer(variance, spread)),
        doubt=float(np.max(level) / (excitation[-1] * np.sqrt(columns))),
    )
