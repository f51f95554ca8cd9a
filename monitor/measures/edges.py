"""Where flags rise and fall: the one place that pairs starts with stops."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterable

    import numpy as np
    from numpy.typing import NDArray

Key = TypeVar("Key", bound="Hashable")


def changed(flags: NDArray[np.bool_], before: NDArray[np.bool_] | None = None) -> NDArray[np.bool_]:
    """(steps, ...) True where a flag is another than at the step before.

    Args:
        flags: (steps, ...).
        before: (...) flags at the step before the first; None: all down.
    """
    found = flags.copy()
    found[1:] ^= flags[:-1]
    if before is not None and len(found):
        found[0] ^= before
    return found


def onsets(flags: NDArray[np.bool_], before: NDArray[np.bool_] | None = None) -> NDArray[np.bool_]:
    """(steps, ...) True where a flag rises; arguments as those of `changed`."""
    return changed(flags, before) & flags


def spans(changes: Iterable[tuple[int, Key, bool]], end: int) -> dict[Key, list[tuple[int, int]]]:
    """Steps [start, stop) during which something lasted, by what it is; one that nobody ended lasts until `end`.

    Args:
        changes: step, key, and whether it starts or stops, in order of time; a stop without a start says nothing.
        end: step behind the last one.
    """
    found: dict[Key, list[tuple[int, int]]] = {}
    running: dict[Key, int] = {}
    for step, key, active in changes:
        if active:
            running.setdefault(key, step)
        elif key in running:
            found.setdefault(key, []).append((running.pop(key), step))
    for key, start in running.items():
        found.setdefault(key, []).append((start, max(start, end)))
    return found
