"""The detectors by name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from monitor.detectors import fixed
from monitor.errors import MonitorError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from monitor.detectors.protocol import Detector

KINDS: dict[str, Callable[[Mapping[str, object], float], Detector[Any]]] = {fixed.KIND: fixed.build}


def build(kind: str, options: Mapping[str, object], sampling_period_sec: float) -> Detector[Any]:
    """Build a detector of this kind.

    Raises:
        MonitorError: unknown kind or option.
    """
    if kind not in KINDS:
        raise MonitorError(f"detector kind is {kind!r}, expected one of {', '.join(sorted(KINDS))}")
    return KINDS[kind](options, sampling_period_sec)
