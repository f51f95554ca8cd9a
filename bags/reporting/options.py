"""What the measures of a report depend on besides the run."""

from dataclasses import dataclass
from typing import final


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ReportOptions:
    """Choices behind the numbers; the report states them.

    Attributes:
        level: Confidence of every interval.
        seed: Of the bootstrap.
        block_sec: Time that is drawn as one piece in the bootstrap, longer than alarms and errors are correlated [s].
        aftermath_sec: Time after an attack's end that counts neither for nor against a monitor [s].
    """

    level: float = 0.95
    seed: int = 1
    block_sec: float = 0.5
    aftermath_sec: float = 0.5
