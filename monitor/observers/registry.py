"""The design methods by name."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from monitor.backstop import guarded
from monitor.certificate import Certificate
from monitor.errors import PlugInError
from monitor.history import sent_outputs
from monitor.observer import Design
from monitor.observers import full_order, reduced_order
from monitor.options import known_kind
from monitor.plugins import Kinds

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from monitor.history import History


# What needs scipy is imported when it is asked for: most runs design without.
def _delayed(history: History, options: Mapping[str, object]) -> Design:
    from monitor.observers import delayed  # noqa: PLC0415 - heavy

    return delayed.design(history, options)


def _open_loop(history: History, options: Mapping[str, object]) -> Design:
    from monitor.observers.uie import design_open_loop  # noqa: PLC0415 - heavy

    return design_open_loop(history, options)


def _closed_loop(history: History, options: Mapping[str, object]) -> Design:
    from monitor.observers.uie import design_closed_loop  # noqa: PLC0415 - heavy

    return design_closed_loop(history, options)


_SHIPPED: Mapping[str, Callable[[History, Mapping[str, object]], Design]] = {
    full_order.KIND: full_order.design,
    reduced_order.KIND: reduced_order.design,
    "delayed": _delayed,
    "op_uie": _open_loop,
    "cl_uie": _closed_loop,
}


def _checked(kind: str, found: object) -> Callable[[History, Mapping[str, object]], Design]:
    if not callable(found) or isinstance(found, type):
        raise PlugInError(
            f"{kind} is {found!r}, expected a function design(history, options) -> monitor.observers.Design"
        )
    return found


GROUP = "dcmg.observers"
KINDS: Kinds[Callable[[History, Mapping[str, object]], Design]] = Kinds(GROUP, _SHIPPED, _checked)
"""All kinds: ours, and those of installed packages (docs/plugins.md)."""


def design(kind: str, history: History, options: Mapping[str, object]) -> Design:
    """Design an observer of this kind from a history; a refusal is a value.

    An output whose column in the history is all NaN is one that is not sent.

    Raises:
        MonitorError: unknown kind or option.
    """
    method = known_kind("observer", kind, KINDS)
    sent, channels = sent_outputs(history)
    made = guarded(lambda: method(sent, options), lambda reason: _refused(kind, reason))
    return replace(made, channels=channels)


def _refused(kind: str, reason: str) -> Design:
    certificate = Certificate(kind=kind, accepted=False, verdict=f"refused: {reason}")
    return Design(kind=kind, observer=None, certificate=certificate)
