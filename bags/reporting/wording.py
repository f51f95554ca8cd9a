"""Numbers and certificates in the words of a report."""

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

from monitor.measures import Measured

NOTHING = "–"  # noqa: RUF001 - a dash in a table


def number(value: float | None, digits: int = 3) -> str:
    """A number with so many significant digits; a dash where there is none."""
    if value is None or math.isnan(value):
        return NOTHING
    if math.isinf(value):
        return "∞"
    return f"{value:.{digits}g}"


def share(value: float | None) -> str:
    """A share in per cent."""
    return NOTHING if value is None or math.isnan(value) else f"{100.0 * value:.3g} %"


def interval(estimate: Measured, *, percent: bool = False, digits: int = 3) -> str:
    """The interval alone, in brackets; nothing where there is none."""
    if estimate.interval is None:
        return ""
    factor = 100.0 if percent else 1.0
    low, high = (number(factor * end, digits) for end in (estimate.interval.low, estimate.interval.high))
    return f"[{low}, {high}]"


def certificate_lines(text: str) -> list[str]:
    """What a design's certificate (JSON) says, in sentences; nothing for one that is not ours."""
    try:
        certificate = json.loads(text)
    except ValueError:
        return []
    if not isinstance(certificate, Mapping):
        return []
    parts = (("data", _data), ("dynamics", _dynamics), ("residual", _residual), ("guarantee", _guarantee))
    lines = [sentence(certificate[name]) for name, sentence in parts if isinstance(certificate.get(name), Mapping)]
    if certificate.get("lag"):
        lines.append(f"At step k its estimate is of step k - {certificate['lag']}.")
    return lines


def _data(data: Mapping[str, Any]) -> str:
    size = f"{data.get('columns')} columns of {data.get('experiments')} experiment(s)"
    rank = f"rank {data.get('rank')} with confidence {number(data.get('rank_confidence'))}"
    exciting = "persistently exciting" if data.get("exciting") else "not shown to be exciting"
    return f"Learned from {size}, {exciting}; {data.get('rank_reason')} ({rank})."


def _dynamics(dynamics: Mapping[str, Any]) -> str:
    radius, seconds = number(dynamics.get("spectral_radius")), dynamics.get("convergence_sec")
    gone = "never die out" if seconds is None else f"shrink to 1 % in {number(seconds)} s"
    return f"Order {dynamics.get('order')}, strategy {dynamics.get('strategy')}; errors {gone} (radius {radius})."


def _residual(residual: Mapping[str, Any]) -> str:
    if residual.get("blind"):
        return "BLIND: the residual stays zero whatever is falsified."
    hidden = list(zip(*residual.get("invisible_bias") or [], strict=True))
    spans = ", ".join(f"({_row(one)})" for one in hidden)
    unseen = f"constant biases along {spans} leave no steady residual" if hidden else "every constant bias shows"
    once, at = _row(residual.get("smallest_bias") or []), _row(residual.get("threshold") or [])
    free = f"{residual.get('stealthy_inputs')} dimension(s) per step stay free to an attacker"
    return f"Residual of rank {residual.get('residual_rank')}: {unseen}; {free}; smallest bias at {at}: {once}."


def _guarantee(guarantee: Mapping[str, Any]) -> str:
    if guarantee.get("exact"):
        return "Unknown inputs of any size are cancelled exactly."
    return f"Unknown inputs are not cancelled: |H e| <= {number(guarantee.get('bound'))} for |w| <= 1."


def _row(values: Sequence[float | None]) -> str:
    return ", ".join("∞" if value is None else number(value) for value in values)
