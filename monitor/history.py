"""The offline experiments on one DGU: everything that a monitor ever learns about the plant."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from monitor.errors import HistoryError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

_TABLES = ("u", "y", "x", "d", "w")
_PERIOD_TOLERANCE = 1e-9  # relative: sampling periods that differ by rounding only are the same
_STILL = 1e-13  # relative: a signal that moves by less than its rounding does not move


def _not_recorded() -> NDArray[np.float64]:
    return np.empty((0, 0))


@dataclass(frozen=True, slots=True)
class Experiment:
    """One recorded stretch of consecutive samples; a NaN marks a value that is missing.

    Attributes:
        u: known inputs, (T, m), SI units; m may be 0.
        y: outputs as they are sent over the network, (T, p).
        x: states, (T, n).
        sampling_period_sec: T_s [s] of this experiment, if it is recorded with it.
        d: inputs applied in the experiment that are unknown online, (T, m_d): for a DGU [I_net + I_L, V_ref + alpha]
            A and V; (T, 0) unless recorded.
        w: what only the DGU itself measures, (T, 1 + neighbours): its load current [A] and the bus voltages of its
            neighbours, ascending [V]; (T, 0) unless recorded.
    """

    u: NDArray[np.float64]
    y: NDArray[np.float64]
    x: NDArray[np.float64]
    sampling_period_sec: float | None = None
    d: NDArray[np.float64] = field(default_factory=_not_recorded)
    w: NDArray[np.float64] = field(default_factory=_not_recorded)

    def __post_init__(self) -> None:
        """Raise HistoryError unless all tables have one row a sample."""
        for name in _TABLES:
            table = np.ascontiguousarray(getattr(self, name), dtype=np.float64)  # BLAS rounds by layout
            if table.shape == (0, 0):
                table = np.empty((len(self.y), 0))
            if table.ndim != 2:  # noqa: PLR2004 - rows and columns
                raise HistoryError(f"{name} has shape {table.shape}, expected (samples, columns)")
            object.__setattr__(self, name, table)
        if not len(self.u) == len(self.y) == len(self.x):
            lengths = f"u, y, x have {len(self.u)}, {len(self.y)}, {len(self.x)} samples"
            raise HistoryError(f"{lengths}, expected the same number: record them at the same instants")
        for name in ("d", "w"):
            if len(getattr(self, name)) != len(self.y):
                found = f"{name} has {len(getattr(self, name))} samples, y has {len(self.y)}"
                raise HistoryError(f"{found}, expected the same number: record them at the same instants")


@dataclass(frozen=True, slots=True)
class History:
    """All experiments on one DGU, recorded with one sampling period.

    Attributes:
        experiments: at least one, with the same numbers of columns.
        sampling_period_sec: T_s [s].
        comparable: the units are comparable as they are (V, A, V s of a DGU): least norms and unknown noise are
            measured in them; else in the spread of each signal, so that units do not matter.
    """

    experiments: tuple[Experiment, ...]
    sampling_period_sec: float
    comparable: bool = False

    def __post_init__(self) -> None:
        """Raise HistoryError when the experiments do not belong together."""
        object.__setattr__(self, "experiments", tuple(self.experiments))
        if not self.experiments:
            raise HistoryError("the history holds no experiment, expected at least one")
        if not self.sampling_period_sec > 0.0:
            raise HistoryError(f"the sampling period is {self.sampling_period_sec} s, expected a positive one")
        first = self.experiments[0]
        for number, experiment in enumerate(self.experiments):
            for name in _TABLES:
                found, expected = getattr(experiment, name).shape[1], getattr(first, name).shape[1]
                if found != expected:
                    raise HistoryError(
                        f"experiment {number} has {found} columns in {name}, experiment 0 has {expected}: "
                        "record the same signals in every experiment"
                    )
            period = experiment.sampling_period_sec
            if period is not None and abs(period / self.sampling_period_sec - 1.0) > _PERIOD_TOLERANCE:
                raise HistoryError(
                    f"experiment {number} is sampled every {period} s, the history every {self.sampling_period_sec} s: "
                    "resample it or leave it out"
                )

    @property
    def inputs(self) -> int:
        """Number m of known inputs."""
        return int(self.experiments[0].u.shape[1])

    @property
    def outputs(self) -> int:
        """Number p of outputs that are sent."""
        return int(self.experiments[0].y.shape[1])

    @property
    def states(self) -> int:
        """Number n of states."""
        return int(self.experiments[0].x.shape[1])


def sent_outputs(history: History) -> tuple[History, tuple[int, ...]]:
    """Leave out the outputs that are never sent: the columns of y that hold nothing but NaN.

    Returns:
        The history of the outputs that are sent, and their positions in the received vector.

    Raises:
        HistoryError: no output is sent.
    """
    never = np.all([np.isnan(experiment.y).all(axis=0) for experiment in history.experiments], axis=0)
    channels = tuple(int(column) for column in np.flatnonzero(~never))
    if not channels:
        raise HistoryError("every output in the history is NaN, expected at least one that is sent")
    if not never.any():
        return history, channels
    kept = (replace(experiment, y=experiment.y[:, channels]) for experiment in history.experiments)
    return replace(history, experiments=tuple(kept)), channels


def single(u: ArrayLike, y: ArrayLike, x: ArrayLike, sampling_period_sec: float) -> History:
    """Make a history of one experiment."""
    tables = [np.asarray(table, dtype=np.float64) for table in (u, y, x)]
    return History((Experiment(tables[0], tables[1], tables[2]),), sampling_period_sec)


@dataclass(frozen=True, slots=True, kw_only=True)
class DataMatrices:
    """Past and future data of T (3), (4): column t holds samples t and t + 1 of one experiment, side by side.

    Attributes:
        U_p: (m, N) known inputs at t.
        Y_p: (p, N) outputs at t.
        X_p: (n, N) states at t.
        U_f: (m, N) known inputs at t + 1.
        Y_f: (p, N) outputs at t + 1.
        X_f: (n, N) states at t + 1.
        experiments: how many experiments contributed.
        dropped: columns left out because of a missing value.
        positions: (N,) when a column starts; consecutive columns of one experiment differ by 1, others by more.
    """

    U_p: NDArray[np.float64]
    Y_p: NDArray[np.float64]
    X_p: NDArray[np.float64]
    U_f: NDArray[np.float64]
    Y_f: NDArray[np.float64]
    X_f: NDArray[np.float64]
    experiments: int
    dropped: int
    positions: NDArray[np.int64]

    @property
    def columns(self) -> int:
        """Number N of columns."""
        return int(self.X_p.shape[1])

    def in_units(self, u: NDArray[np.float64], y: NDArray[np.float64], x: NDArray[np.float64]) -> DataMatrices:
        """The same data with every signal multiplied by its factor, (m,), (p,), (n,)."""
        factors = {"U_p": u, "Y_p": y, "X_p": x, "U_f": u, "Y_f": y, "X_f": x}
        return replace(self, **{name: factor[:, None] * getattr(self, name) for name, factor in factors.items()})


def data_matrices(history: History) -> DataMatrices:
    """Stack the experiments side by side (mosaic Hankel matrices of depth 2); columns with a gap are dropped.

    Raises:
        HistoryError: nothing is sent or measured, too few columns are left, or a signal never changes.
    """
    n, m, p = history.states, history.inputs, history.outputs
    if n == 0 or p == 0:
        raise HistoryError(f"the history has {p} outputs and {n} states, expected at least one of each")
    past, future, positions, start = [], [], [], 0
    for experiment in history.experiments:
        samples = np.hstack([experiment.u, experiment.y, experiment.x])
        past.append(samples[:-1])
        future.append(samples[1:])
        positions.append(start + np.arange(len(samples) - 1))
        start += len(samples)
    before, after, position = np.vstack(past).T, np.vstack(future).T, np.concatenate(positions)
    whole = np.isfinite(before).all(axis=0) & np.isfinite(after).all(axis=0)
    dropped = int(np.count_nonzero(~whole))
    before, after = before[:, whole], after[:, whole]
    _check_length(before.shape[1], dropped, n, m)
    _check_motion(np.hstack([before, after]), m, p)
    cuts = np.cumsum([m, p])
    U_p, Y_p, X_p = np.split(before, cuts)
    U_f, Y_f, X_f = np.split(after, cuts)
    return DataMatrices(
        U_p=U_p,
        Y_p=Y_p,
        X_p=X_p,
        U_f=U_f,
        Y_f=Y_f,
        X_f=X_f,
        experiments=len(history.experiments),
        dropped=dropped,
        positions=position[whole].astype(np.int64),
    )


def _check_length(columns: int, dropped: int, n: int, m: int) -> None:
    """Refuse a history with fewer columns than its data would span with one unknown input."""
    needed = n + 2 * m + 1
    if columns < needed:
        gaps = f" ({dropped} more hold NaN or infinite values)" if dropped else ""
        raise HistoryError(
            f"the history has {columns} pairs of consecutive samples{gaps}, expected at least {needed} "
            f"for {n} states and {m} known inputs: record longer"
        )


def _check_motion(samples: NDArray[np.float64], m: int, p: int) -> None:
    """Refuse a signal that never changes: nothing can be learned about how it acts."""
    for row, signal in enumerate(samples):
        if np.max(signal) - np.min(signal) <= _STILL * np.max(np.abs(signal)):
            name = f"u[{row}]" if row < m else f"y[{row - m}]" if row < m + p else f"x[{row - m - p}]"
            raise HistoryError(f"{name} is constant at {signal[0]:g} in the whole history: excite it, or leave it out")
