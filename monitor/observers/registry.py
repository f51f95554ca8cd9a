"""The design methods by name."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from monitor.errors import MonitorError
from monitor.history import sent_outputs
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

    An output whose column in the history is all NaN is one that is not sent.

    Raises:
        MonitorError: unknown kind or option.
    """
    if kind not in KINDS:
        raise MonitorError(f"observer kind is {kind!r}, expected one of {', '.join(sorted(KINDS))}")
    sent, channels = sent_outputs(history)
    return replace(KINDS[kind](sent, options), channels=channels)
