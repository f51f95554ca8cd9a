"""How long the windows must be, told from the record.

[U; Y] of windows of k samples has rank k m + o_k on exact data, where o_k grows with k up to the order of the plant and
stays there: the first k with o_k = o_k+1 is its lag. Windows with `past` <= lag do not fix the state in which the
window begins: what is reconstructed from them is wrong, although every equation of I holds on the record. `future` is
long enough when condition (8) of I holds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from monitor.errors import HistoryError
from monitor.input_reconstruction.behaviour import Behaviour, shows_order, truncate, untruncated
from monitor.input_reconstruction.windows import Windows, cut_windows, hankel_of
from monitor.input_reconstruction.zeros import invariant_zeros, invisible, invisible_below, visibility

if TYPE_CHECKING:
    from monitor.history import History

_PREFERRED = 5  # N_ini of I
_LONGEST = 40  # windows that are tried when nothing is said
_LONGER = 6  # so much longer ones are tried where noise hides the order
_CLEAR = 1e-4  # a visibility above it needs no larger future
_ABOVE_NOISE = 3.0  # times the noise
_ALIKE = 2.0  # misfits of least squares within this factor are alike


@dataclass(frozen=True, slots=True, kw_only=True)
class Sizes:
    """What is said about the windows beforehand; None: it is chosen.

    Attributes:
        past: N_ini.
        future: output samples used from t on.
        order: of the plant.
        tolerance: what counts as rounding, relative to the largest singular value.
        truncated: ranks are decided; else everything is least squares.
    """

    past: int | None
    future: int | None
    order: int | None
    tolerance: float
    truncated: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Memory:
    """Order and lag of the plant as exact windows show them; None where noise or a short record hides them."""

    order: int | None = None
    lag: int | None = None

    @property
    def needed(self) -> int | None:
        """Smallest `past`: the last past output is predicted from one sample less, which must reach the lag."""
        return None if self.lag is None else max(self.lag + 1, 2)


def memory_of(history: History, tolerance: float) -> Memory:
    """Look for the depth at which [U; Y] stops to show more of the state."""
    m, p = history.inputs, history.outputs
    before: int | None = None
    for depth in range(1, _LONGEST + 1):
        stacked = hankel_of(history, depth)
        if stacked.shape[1] <= depth * (m + p):
            break
        values = np.linalg.svd(stacked, compute_uv=False)
        rank = int(np.count_nonzero(values > tolerance * values[0]))
        if before is not None and rank - depth * m == before:
            return Memory(order=before, lag=depth - 1)
        before = rank - depth * m
    return Memory()


def fit_windows(history: History, sizes: Sizes) -> tuple[Windows, Behaviour]:
    """Cut the windows, with what is not said chosen, and decide their ranks.

    Raises:
        HistoryError: the record is too short for the windows, or windows that are too short for the plant.
    """
    memory = memory_of(history, sizes.tolerance) if sizes.truncated else Memory()
    if sizes.past is not None:
        if memory.needed is not None and sizes.past < memory.needed:
            raise HistoryError(
                f"past is {sizes.past}, too short: the record shows order {memory.order} within {memory.lag} samples, "
                f"expected past >= {memory.needed}"
            )
        return _long_enough(history, sizes, sizes.past)
    wanted = max(_PREFERRED, memory.needed or 0, (sizes.order or 0) + 1 if memory.lag is None else 0)
    least = memory.needed or min(wanted, (sizes.order or _PREFERRED - 1) + 1)
    for past in range(wanted, least, -1):
        try:
            return _long_enough(history, sizes, past)
        except HistoryError:
            continue  # a shorter window may fit
    return _long_enough(history, sizes, least)


def larger_future(history: History, sizes: Sizes, windows: Windows) -> int | str:
    """The first larger future for which condition (8) holds; in words why none is found."""
    order = memory_of(history, sizes.tolerance).order or windows.past
    for future in range(windows.future + 1, order + 2):
        try:
            _, behaviour = _cut(history, sizes, windows.past, future)
        except HistoryError as error:
            return f"whether a larger future shows it cannot be told: {error}"
        if behaviour.decided and not invisible(behaviour):
            return future
    return "no larger future shows it: more outputs are needed"


def without_zeros(history: History, sizes: Sizes, windows: Windows, limit: float) -> tuple[Windows, Behaviour] | None:
    """The shortest longer windows whose zeros all lie below the limit; None when none do within the order.

    An input may leave no trace over a short window and show in a longer one; what leaves none over as many samples as
    the plant has states never shows.
    """
    order = memory_of(history, sizes.tolerance).order or windows.past
    for past in range(windows.past + 1, order + 2):
        try:
            found = _cut(history, sizes, past, windows.future)
        except HistoryError:
            return None
        if not found[1].decided or invisible(found[1]):
            return None
        if np.max(np.abs(invariant_zeros(found[1], past)), initial=0.0) < limit:
            return found
    return None


def _long_enough(history: History, sizes: Sizes, past: int) -> tuple[Windows, Behaviour]:
    """Windows of this `past`, longer ones where noise hides the lag and shorter ones do not show the whole order."""
    windows, behaviour = _with_future(history, sizes, past)
    if not sizes.truncated or _confirmed(history, sizes, past, behaviour):
        return windows, behaviour
    for longer in range(past + 1, past + _LONGER):
        try:
            found = _with_future(history, sizes, longer)
        except HistoryError:
            break
        if found[1].decided and _confirmed(history, sizes, longer, found[1]):
            if sizes.past is None:
                return found
            raise HistoryError(
                f"past is {past}, too short: windows of {longer} samples show order {found[1].order}, those of {past} "
                f"and {past - 1} do not; expected past >= {longer}"
            )
    if behaviour.decided:
        raise HistoryError(
            f"past is {past}, too short: windows of {past} samples show order {behaviour.order}, those of {past - 1} "
            f"do not; expected past >= {(behaviour.order or 0) + 1}"
        )
    return windows, behaviour


def _confirmed(history: History, sizes: Sizes, past: int, behaviour: Behaviour) -> bool:
    """Whether the order is decided, and windows that are one sample shorter show the same one."""
    if behaviour.order is None:
        return False
    order, shorter = behaviour.order, past - 1
    return past > order or shows_order(hankel_of(history, shorter), shorter * history.inputs + order, sizes.tolerance)


def _with_future(history: History, sizes: Sizes, past: int) -> tuple[Windows, Behaviour]:
    """The shortest future that shows the input clearly, else the one that shows it best."""
    if sizes.future is not None:
        return _cut(history, sizes, past, sizes.future)
    tried = [_cut(history, sizes, past, 1)]
    shown = [_clearness(tried[0][1])]
    longest = (tried[0][1].order or past) + 1
    while shown[-1] < 1.0 and len(tried) < longest:
        try:
            tried.append(_cut(history, sizes, past, len(tried) + 1))
        except HistoryError:
            break
        shown.append(_clearness(tried[-1][1]))
    if tried[0][1].decided:
        return tried[int(np.argmax(shown))]
    misfits = [_misfit(windows) for windows, _ in tried]
    return tried[next(at for at, one in enumerate(misfits) if one <= _ALIKE * min(misfits))]


def _clearness(behaviour: Behaviour) -> float:
    """How clearly the input at t shows: 1 where neither rounding nor noise can be taken for it."""
    return visibility(behaviour) / max(_CLEAR, _ABOVE_NOISE * invisible_below(behaviour))


def _cut(history: History, sizes: Sizes, past: int, future: int) -> tuple[Windows, Behaviour]:
    windows = cut_windows(history, past, future)
    if not sizes.truncated:
        return windows, untruncated(windows)
    return windows, truncate(windows, sizes.order, sizes.tolerance)


def _misfit(windows: Windows) -> float:
    """Share of the input at t that least squares leave unexplained."""
    now = windows.u_now - np.mean(windows.u_now, axis=1, keepdims=True)
    H = windows.H - np.mean(windows.H, axis=1, keepdims=True)
    return float(np.linalg.norm(now - now @ np.linalg.pinv(H) @ H) / max(float(np.linalg.norm(now)), 1e-300))
