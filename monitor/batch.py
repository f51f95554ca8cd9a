"""Whole recordings through an observer: the numbers of one step after the other, bit for bit, sooner."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from monitor.errors import HistoryError
from monitor.linear import matvec, rows_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    Floats = NDArray[np.float64]

__all__ = ["Estimates", "received", "run_linear", "table"]

_BLOCK = 10_000  # samples whose products are in memory as Python floats
_THREE = 3  # order and inputs of the observers of a DGU, whose sums are written out


class _Sized(Protocol):
    @property
    def inputs(self) -> int: ...
    @property
    def outputs(self) -> int: ...


class _Linear(_Sized, Protocol):
    """What of a linear observer is needed here."""

    @property
    def states(self) -> int: ...
    def matrices(self) -> dict[str, Floats]: ...
    def init(self, u: Sequence[Any], y: Sequence[Any]) -> Any: ...  # noqa: ANN401 - components


class Estimates(NamedTuple):
    """What an observer concluded over a whole recording.

    Attributes:
        estimate: row t is the estimate of x at t - lag, shape (T, n), units of x.
        residual: shape (T, p), units of y; NaN where a sample was missing.
    """

    estimate: Floats
    residual: Floats


def run_linear(observer: _Linear, u: ArrayLike | None, y: ArrayLike, x0: ArrayLike | None) -> Estimates:
    """Run a linear observer over a recording: its state step by step, everything else at once.

    Args:
        observer: a linear observer.
        u: known inputs, shape (T, m); None: there are none.
        y: received outputs, shape (T, p).
        x0: first estimate, shape (n,), units of x; None: what the observer itself starts with.

    Raises:
        HistoryError: the arrays do not have the columns that the observer was designed for, or x0 not n numbers.
    """
    inputs, outputs = received(observer, u, y)
    v = np.hstack([inputs, outputs])
    if not len(v):
        return Estimates(np.empty((0, observer.states)), np.empty((0, observer.outputs)))
    matrices = observer.matrices()
    z = _states(matrices["A"], matrices["B"], v, _start(observer, v[0], x0))
    components = [*z.T, *v.T]
    residual = matvec(rows_of(np.hstack([matrices["H"], matrices["J"]])), components)
    estimate = matvec(rows_of(np.hstack([matrices["M"], matrices["D"]])), components)
    return Estimates(_columns(estimate, len(v)), _columns(residual, len(v)))


def received(observer: _Sized, u: ArrayLike | None, y: ArrayLike) -> tuple[Floats, Floats]:
    """Known inputs and outputs as an observer takes them.

    Raises:
        HistoryError: they have other columns.
    """
    outputs = table("y", y)
    inputs = table("u", u, samples=len(outputs))
    for name, found, wanted in (("y", outputs, observer.outputs), ("u", inputs, observer.inputs)):
        if found.shape != (len(outputs), wanted):
            raise HistoryError(f"{name} has shape {found.shape}, expected {(len(outputs), wanted)}, as in the design")
    return inputs, outputs


def table(name: str, values: ArrayLike | None, samples: int = 0, call: str = "run(u, y)") -> Floats:
    """Samples x columns, from whatever looks like it: lists, pandas, xarray, one column without a second axis.

    Raises:
        HistoryError: it is no table of numbers.
    """
    if values is None:
        return np.empty((samples, 0))
    try:
        found = np.ascontiguousarray(values, dtype=np.float64)  # one layout, so that sums have one order
    except (TypeError, ValueError):
        raise HistoryError(f"{name} is no table of numbers, expected shape (samples, columns): {call}") from None
    if found.ndim == 1:
        found = found[:, None]
    if found.ndim != 2:  # noqa: PLR2004 (rows and columns)
        raise HistoryError(f"{name} has shape {found.shape}, expected (samples, columns), as in {call}")
    return found


def _start(observer: _Linear, first: Floats, x0: ArrayLike | None) -> Sequence[float]:
    """z_0, such that M z_0 + D v_0 is the wanted first estimate."""
    if x0 is None:
        start: Any = observer.init(first[: observer.inputs].tolist(), first[observer.inputs :].tolist())
        return [float(one) for one in start]
    wanted = np.atleast_1d(np.asarray(x0, dtype=np.float64))
    if wanted.shape != (observer.states,):
        raise HistoryError(
            f"x0 has shape {wanted.shape}, expected {(observer.states,)}: the first estimate of the state"
        )
    matrices = observer.matrices()
    found: list[float] = np.linalg.lstsq(matrices["M"], wanted - matrices["D"] @ first, rcond=None)[0].tolist()
    return found


def _states(a: Floats, b: Floats, v: Floats, start: Sequence[float]) -> Floats:
    """z_t of every sample, shape (T, q)."""
    if len(a) == v.shape[1] == _THREE:
        return _states_three(a, b, v, start)
    rows = rows_of(np.hstack([a, b]))
    z: Any = start
    found = []
    for row in v.tolist():
        found.append(z)
        z = matvec(rows, (*z, *row))
    return np.array(found, dtype=np.float64).reshape(len(v), len(a))


def _states_three(into: Floats, of: Floats, v: Floats, start: Sequence[float]) -> Floats:
    """The sums of `matvec` written out: those of the state one by one, the products of what was received at once."""
    (a, b, c), (d, e, f), (g, h, i) = into.tolist()
    x, y, z = start
    found = np.empty((len(v), _THREE))
    for begin in range(0, len(v), _BLOCK):
        block = v[begin : begin + _BLOCK]
        products = [(of[row, column] * block[:, column]).tolist() for row in range(3) for column in range(3)]
        told: list[float] = []
        for p, q, r, s, t, u, k, m, n in zip(*products, strict=True):
            told += (x, y, z)
            x, y, z = (
                0.0 + a * x + b * y + c * z + p + q + r,
                0.0 + d * x + e * y + f * z + s + t + u,
                0.0 + g * x + h * y + i * z + k + m + n,
            )
        found[begin : begin + _BLOCK] = np.array(told).reshape(-1, _THREE)
    return found


def _columns(components: Sequence[Any] | Floats, samples: int) -> Floats:
    if not len(components):
        return np.empty((samples, 0))
    return np.ascontiguousarray(np.stack([np.broadcast_to(one, (samples,)) for one in components], axis=1))
