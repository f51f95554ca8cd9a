"""What the measures of a report depend on besides the run."""

from dataclasses import dataclass

MOST_BLOCKS = 500  # more would only cost time: intervals do not get better


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportOptions:
    """Choices behind the numbers; the report states them.

    Attributes:
        level: Confidence of every interval.
        seed: Of the bootstrap.
        block_sec: Least time that is drawn as one piece in the bootstrap, longer than alarms and errors are correlated;
            more in long runs, of which there are MOST_BLOCKS pieces [s].
        aftermath_sec: Time after an attack's end that counts neither for nor against a monitor [s].
    """

    level: float = 0.95
    seed: int = 1
    block_sec: float = 0.5
    aftermath_sec: float = 0.5

    def block_steps(self, steps: int, period_sec: float) -> int:
        """Steps of a piece of a run."""
        return max(round(self.block_sec / period_sec), -(-steps // MOST_BLOCKS), 1)


DEFAULTS = ReportOptions()
"""Those of the tables that `dcmg run`, `simulate` and `replay` print."""
