"""Windows of recorded inputs and outputs: the Hankel matrices that input reconstruction is built on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from monitor.errors import HistoryError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.history import History

_SPARE = 2  # windows beyond the rows of [U_p; u_t; Y], which fit anything
_RANK = 1e-10  # relative: an input direction below it was never excited


@dataclass(frozen=True, slots=True, kw_only=True)
class Windows:
    """Every column is one window of L = past + future consecutive samples, instant t being sample number `past`.

    Attributes:
        U_past: (past m, N) inputs at t - past … t - 1, oldest first.
        u_now: (m, N) inputs at t, what is to be reconstructed.
        U_later: ((future - 1) m, N) inputs at t + 1 … t + future - 1; known in the record, never online.
        Y: (L p, N) outputs at t - past … t + future - 1.
        past: number of past samples.
        future: number of output samples from t on.
        inputs: m.
        outputs: p.
        dropped: windows left out because of a missing value.
    """

    U_past: NDArray[np.float64]
    u_now: NDArray[np.float64]
    U_later: NDArray[np.float64]
    Y: NDArray[np.float64]
    past: int
    future: int
    inputs: int
    outputs: int
    dropped: int

    @property
    def H(self) -> NDArray[np.float64]:  # noqa: N802 - the symbol of the paper
        """H = [U_p; Y_p; Y_f], what is known online once the past inputs are."""
        return np.vstack([self.U_past, self.Y])

    @property
    def Y_past(self) -> NDArray[np.float64]:  # noqa: N802 - the symbol of the paper
        """Outputs before t, (past p, N)."""
        return self.Y[: self.past * self.outputs]

    @property
    def columns(self) -> int:
        """Number N of windows."""
        return int(self.Y.shape[1])


def cut_windows(history: History, past: int, future: int) -> Windows:
    """Cut all experiments into windows and put them side by side (mosaic Hankel matrices); gaps drop a window.

    Args:
        history: u holds the inputs to reconstruct, as recorded offline; x is not used and may have no column.
        past: N_ini, at least 2 and at least the lag of the plant.
        future: output samples from t on; 1 when an input acts at once (D of full column rank), else more.

    Raises:
        HistoryError: no inputs or outputs, no window left, or inputs that are not exciting.
    """
    m, p, length = history.inputs, history.outputs, past + future
    if m == 0 or p == 0:
        raise HistoryError(f"the history has {m} inputs and {p} outputs, expected the inputs that are to be found")
    inputs = np.hstack([_hankel(experiment.u, length) for experiment in history.experiments])
    Y = np.hstack([_hankel(experiment.y, length) for experiment in history.experiments])
    whole = np.isfinite(inputs).all(axis=0) & np.isfinite(Y).all(axis=0)
    dropped = int(np.count_nonzero(~whole))
    inputs, Y = inputs[:, whole], Y[:, whole]
    _check_length(Y.shape[1], max((past + 1) * m + length * p, length * m), dropped, length)
    _check_excitation(inputs)
    U_past, u_now, U_later = np.split(inputs, [past * m, (past + 1) * m])
    return Windows(
        U_past=U_past,
        u_now=u_now,
        U_later=U_later,
        Y=Y,
        past=past,
        future=future,
        inputs=m,
        outputs=p,
        dropped=dropped,
    )


def hankel_of(history: History, depth: int) -> NDArray[np.float64]:
    """[U; Y] of all windows of this depth without a gap, (depth (m + p), N)."""
    parts = [np.vstack([_hankel(one.u, depth), _hankel(one.y, depth)]) for one in history.experiments]
    stacked = np.hstack(parts)
    return np.asarray(stacked[:, np.isfinite(stacked).all(axis=0)])


def _hankel(signal: NDArray[np.float64], depth: int) -> NDArray[np.float64]:
    """(depth k, N) matrix whose column i stacks samples i … i + depth - 1 of a signal (T, k)."""
    columns = max(len(signal) - depth + 1, 0)
    return np.vstack([signal[row : row + columns].T for row in range(depth)])


def _check_length(columns: int, rows: int, dropped: int, length: int) -> None:
    """Refuse a record with fewer windows than rows of [U_p; u_t; Y]: anything fits so few."""
    rows += _SPARE
    if columns < rows:
        gaps = f" ({dropped} more hold NaN or infinite values)" if dropped else ""
        raise HistoryError(
            f"the history has {columns} windows of {length} samples{gaps}, expected at least {rows}: record longer"
        )


def _check_excitation(inputs: NDArray[np.float64]) -> None:
    """Refuse inputs that do not move freely over a window (assumption 1 of I, as far as it needs no order)."""
    rows = len(inputs)
    values = np.linalg.svd(inputs, compute_uv=False)
    rank = int(np.count_nonzero(values > _RANK * values[0]))
    if rank < rows:
        raise HistoryError(
            f"the recorded inputs are not exciting: their windows have rank {rank}, expected {rows}: vary every input "
            "in every sample"
        )
