"""The full-order observer, as fast as one asks for."""

from collections.abc import Mapping
from dataclasses import replace

from monitor.history import History
from monitor.observers import Design, full_order


def design(history: History, options: Mapping[str, object]) -> Design:
    """Design it; its estimation error shrinks to a tenth or less at every step, unless told otherwise."""
    made = full_order.design(history, {"decay": 0.1, **options})
    return replace(made, kind="brisk", certificate=replace(made.certificate, kind="brisk"))
