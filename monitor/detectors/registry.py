"""The detectors by name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from monitor.detectors import calibrated, chi_squared, cusum, fixed, n_of_m, noise_bound
from monitor.options import check_kind

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from monitor.detectors.protocol import Detector


def build(kind: str, options: Mapping[str, object], sampling_period_sec: float) -> Detector[Any]:
    """Build a detector of this kind.

    Raises:
        MonitorError: unknown kind or option.
    """
    check_kind("detector", kind, KINDS)
    return KINDS[kind](options, sampling_period_sec)


KINDS: dict[str, Callable[[Mapping[str, object], float], Detector[Any]]] = {
    fixed.KIND: fixed.build,
    noise_bound.KIND: noise_bound.build,
    chi_squared.KIND: chi_squared.build,
    cusum.KIND: cusum.build,
    n_of_m.KIND: n_of_m.builder(build),
    calibrated.KIND: calibrated.build,
}
