"""The design methods by name."""

from __future__ import annotations

from typing import TYPE_CHECKING

from monitor.errors import MonitorError
from monitor.observers import full_order, reduced_order

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from monitor.history import History
    from monitor.observers.protocol import Design

KINDS: dict[str, Callable[[History, Mapping[str, object]], Design]] = {
    full_order.KIND: full_order.design,
    reduced_order.KIND: reduced_order.design,
}


def design(kind: str, history: History, options: Mapping[str, object]) -> Design:
    """Design an observer of this kind from a history; a refusal is a value.

    Raises:
        MonitorError: unknown kind or option.
    """
    if kind not in KINDS:
        raise MonitorError(f"observer kind is {kind!r}, expected one of {', '.join(sorted(KINDS))}")
    return KINDS[kind](history, options)
