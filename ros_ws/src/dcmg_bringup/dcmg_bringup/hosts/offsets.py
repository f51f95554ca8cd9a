"""How far the clock of another host is from ours, by asking for the time and back."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Offset:
    """One measurement: theirs minus ours is within offset_ns ± bound_ns.

    With t1 the question, t2 the answer by their clock and t4 its arrival, offset = t2 - (t1 + t4) / 2, and whatever the
    way there and the way back took, the error is at most (t4 - t1) / 2 (Cristian 1989).

    Attributes:
        offset_ns: their clock minus ours [ns].
        bound_ns: largest error [ns].
        at_ns: when it was measured, by our clock [ns].
    """

    offset_ns: int
    bound_ns: int
    at_ns: int


def measured(asked_ns: int, theirs_ns: int, answered_ns: int) -> Offset:
    """Return what one question and its answer tell."""
    middle = (asked_ns + answered_ns) // 2
    return Offset(offset_ns=theirs_ns - middle, bound_ns=(answered_ns - asked_ns + 1) // 2, at_ns=answered_ns)


def better(one: Offset | None, other: Offset) -> Offset:
    """Return the measurement with the smaller bound."""
    return other if one is None or other.bound_ns < one.bound_ns else one


def in_words(host: str, offset: Offset) -> str:
    """Say whose clock is ahead, and how sure that is."""
    bound_ms = offset.bound_ns * 1e-6
    if abs(offset.offset_ns) <= offset.bound_ns:
        return f"clock of host {host}: the same as here, to {bound_ms:.3g} ms"
    side = "ahead" if offset.offset_ns > 0 else "behind"
    return f"clock of host {host}: {abs(offset.offset_ns) * 1e-6:.4g} ms {side} (to {bound_ms:.2g} ms)"
