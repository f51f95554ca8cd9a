"""How regularly something was sampled: period, jitter, gaps, repeated and disordered stamps."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bags.foreign.spill import Rows

_ROUND_DIGITS = 3
_ROUND_WITHIN = 1e-3  # a period this close to a number of three digits is that number
_GAP = 1.5  # steps longer than this many periods are gaps
_SHOWN_GAPS = 5
_AT_ONCE = 4096  # messages in memory


@dataclass(frozen=True, slots=True, kw_only=True)
class Gap:
    """A stretch without messages.

    Attributes:
        after_sec: Instant of the last message before it, since the first one [s].
        length_sec: Time between the messages around it [s].
    """

    after_sec: float
    length_sec: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Regularity:
    """What the stamps of one track say.

    Attributes:
        name: Topic or file.
        messages: How many, all of them.
        start_ns: First instant.
        end_ns: Last instant.
        period_sec: Median step [s], NaN when there is none.
        jitter_sec: Standard deviation of the steps that are no gaps [s].
        worst_jitter_sec: Largest deviation of such a step from the period [s].
        gaps: Stretches without messages, in order.
        repeated: Messages whose stamp is that of another one.
        conflicting: Those among them that say something else, None where values were not looked at.
        out_of_order: Messages that stand behind a later one in the file.
    """

    name: str
    messages: int
    start_ns: int
    end_ns: int
    period_sec: float
    jitter_sec: float
    worst_jitter_sec: float
    gaps: tuple[Gap, ...]
    repeated: int
    conflicting: int | None
    out_of_order: int

    def sentences(self) -> list[str]:
        """What a person should know, a line each."""
        span_sec = (self.end_ns - self.start_ns) * 1e-9
        jitter = f"jitter {self.jitter_sec:.2g} s (worst {self.worst_jitter_sec:.2g} s)"
        steps = f"median step {self.period_sec:g} s, {jitter}" if span_sec else "one instant: no clock to sample by"
        lines = [f"{self.name}: {self.messages} messages over {span_sec:g} s, {steps}"]
        lines += [
            f"{self.name}: gap of {gap.length_sec:g} s after {gap.after_sec:g} s" for gap in self.gaps[:_SHOWN_GAPS]
        ]
        if len(self.gaps) > _SHOWN_GAPS:
            lines.append(f"{self.name}: {len(self.gaps) - _SHOWN_GAPS} more gaps")
        if self.repeated:
            others = "" if self.conflicting is None else f", {self.conflicting} of them with other values"
            lines.append(f"{self.name}: {self.repeated} repeated stamps{others}")
        if self.out_of_order:
            lines.append(f"{self.name}: {self.out_of_order} messages out of order, put into order by their stamps")
        return lines

    def document(self) -> dict[str, Any]:
        """For a JSON document."""
        return {
            "name": self.name,
            "messages": self.messages,
            "start_ns": self.start_ns,
            "end_ns": self.end_ns,
            "period_sec": self.period_sec if np.isfinite(self.period_sec) else None,
            "jitter_sec": self.jitter_sec,
            "worst_jitter_sec": self.worst_jitter_sec,
            "gaps": [{"after_sec": gap.after_sec, "length_sec": gap.length_sec} for gap in self.gaps],
            "repeated": self.repeated,
            "conflicting": self.conflicting,
            "out_of_order": self.out_of_order,
        }


def regularity(
    name: str,
    stamps_ns: NDArray[np.int64],
    values: Rows | None,
    period_ns: int | None = None,
    rows: NDArray[np.intp] | None = None,
) -> Regularity:
    """Look at the stamps of a track.

    Args:
        name: Topic or file.
        stamps_ns: Of the messages that count, in the order of the file, shape (messages,), at least one.
        values: What each message of the file says, shape (messages of the file, signals); None: do not look at them.
        period_ns: T_s if it is known, else the median step counts.
        rows: Places of the messages that count, shape (messages,); None: all.
    """
    disordered = int((stamps_ns < np.maximum.accumulate(stamps_ns)).sum())
    order = np.argsort(stamps_ns, kind="stable") if disordered else None
    ordered = stamps_ns if order is None else stamps_ns[order]
    steps = np.diff(ordered)
    same = steps == 0
    conflicting = None if values is None else _conflicting(values, np.flatnonzero(same), order, rows)
    steps, ends = steps[~same], ordered[1:][~same]
    period = float(np.median(steps)) if len(steps) else float("nan")
    wanted = period if period_ns is None else float(period_ns)
    gap = steps > _GAP * wanted
    off = np.abs(steps[~gap] - wanted)
    gaps = zip(((ends - steps)[gap] - ordered[0]).tolist(), steps[gap].tolist(), strict=True)
    return Regularity(
        name=name,
        messages=len(stamps_ns),
        start_ns=int(ordered[0]),
        end_ns=int(ordered[-1]),
        period_sec=period * 1e-9,
        jitter_sec=float(steps[~gap].std()) * 1e-9 if (~gap).any() else 0.0,
        worst_jitter_sec=float(off.max()) * 1e-9 if len(off) else 0.0,
        gaps=tuple(Gap(after_sec=after * 1e-9, length_sec=length * 1e-9) for after, length in gaps),
        repeated=int(same.sum()),
        conflicting=conflicting,
        out_of_order=disordered,
    )


def _conflicting(
    values: Rows, same: NDArray[np.intp], order: NDArray[np.intp] | None, rows: NDArray[np.intp] | None
) -> int:
    """How many messages say something else than the one before them that has their stamp."""
    found = 0
    for start in range(0, len(same), _AT_ONCE):
        before, after = same[start : start + _AT_ONCE], same[start : start + _AT_ONCE] + 1
        if order is not None:
            before, after = order[before], order[after]
        if rows is not None:
            before, after = rows[before], rows[after]
        old, new = values[before], values[after]
        found += int((~((old == new) | (np.isnan(old) & np.isnan(new))).all(axis=1)).sum())
    return found


def detected_period_ns(stamps_ns: NDArray[np.int64]) -> int | None:
    """T_s [ns] of a track: its median step, rounded to three digits when that close; None below 2 stamps."""
    steps = np.diff(np.unique(stamps_ns))
    if not len(steps):
        return None
    median = float(np.median(steps))
    rounded = float(f"{median:.{_ROUND_DIGITS - 1}e}")
    return max(1, round(rounded if abs(rounded - median) <= _ROUND_WITHIN * median else median))
