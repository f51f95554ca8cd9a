"""How well the times between messages are kept, in memory that does not grow with the number of messages."""

from __future__ import annotations

from dataclasses import dataclass, field

_BIN_SEC = 1e-5
_BINS = 100_000  # up to one second


@dataclass(slots=True)
class Punctuality:
    """Histogram of |time between two messages as published - as wanted|.

    Attributes:
        counts: how often each error occurred, in bins of 10 us; the last one holds all that are larger.
        total: number of errors.
        worst_sec: the largest error [s].
    """

    counts: list[int] = field(default_factory=lambda: [0] * _BINS)
    total: int = 0
    worst_sec: float = 0.0

    def add(self, error_sec: float) -> None:
        """Take one error."""
        size = abs(error_sec)
        self.counts[min(int(size / _BIN_SEC), _BINS - 1)] += 1
        self.total += 1
        self.worst_sec = max(self.worst_sec, size)

    def quantile_sec(self, share: float) -> float:
        """Error that so large a share does not exceed, to 10 us [s]; 0 without any."""
        wanted, seen = share * self.total, 0
        for number, count in enumerate(self.counts):
            seen += count
            if seen >= wanted and count:
                return min((number + 1) * _BIN_SEC, self.worst_sec)
        return 0.0
