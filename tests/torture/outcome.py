"""What one case of torture came to."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """One case.

    Attributes:
        kind: name of its kind, as `run.py` lists them.
        seed: what repeats it.
        what: what was done, in words.
        row: under which row of the printed table it counts.
        broken: promises that did not hold; empty: all did.
        seconds: how long the promise took that has a bound, NaN: none has.
        note: what else is worth counting.
    """

    kind: str
    seed: int
    what: str
    row: str
    broken: tuple[str, ...]
    seconds: float = float("nan")
    note: str = ""
