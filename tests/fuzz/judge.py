"""One answer of a design against the truth: right, agreed, borderline, wrong."""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

from tests.fuzz.oracle import Answer

if TYPE_CHECKING:
    from tests.fuzz.fresh import Misfit
    from tests.fuzz.oracle import Truth

_GROSS = 1e-2  # of the largest signal: whatever the doubt, an exact record leaves less
_NOISY = 0.5  # of the largest signal: an estimate from a noisy record that is off by more estimates nothing
_EXACT = 1e-6  # of the largest signal, what "exact" means on fresh data
_DOUBTED = 1e3  # rounding of the record is amplified by this much at most beyond the oracle's estimate
_STATED = 30.0  # a stated figure is the largest of some samples; on others it may be this much larger
_ROUNDED = 1e-7  # of the largest signal: rounding of a run that grows more than the record did
_REPEATED = 1e-4  # placed poles that coincide are moved by this much by rounding
_SAID = re.compile(
    r"borderline|ambiguous|not told|cannot be told|not clear|undecided|too noisy|close to", re.IGNORECASE
)

_LONGER = re.compile(r"record (longer|\d+ more)")  # says by how many samples it is too short


class Outcome(Enum):
    """What became of one case."""

    RIGHT = "accepted, right"
    AGREED = "refused, agreed"
    OPEN = "borderline"
    UNSAID = "borderline, unsaid"
    MISSED = "refused, possible"
    STRATEGY = "refused by strategy"
    DISPUTED = "accepted, disputed"
    WRONG = "accepted, WRONG"
    UNITS = "depends on units"
    EXCEPTION = "exception"

    @property
    def bad(self) -> bool:
        """Whether it breaks a promise."""
        return self in {Outcome.WRONG, Outcome.UNITS, Outcome.EXCEPTION}


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """One judged case.

    Attributes:
        kind: of the trial.
        seed: of the case.
        outcome: what became of it.
        detail: one line on why.
    """

    kind: str
    seed: int
    outcome: Outcome
    detail: str

    @property
    def example(self) -> str:
        """The line for `counter_examples.py`."""
        return f'("{self.kind}", {self.seed}),'


def refusal(truth: Truth, verdict: str) -> tuple[Outcome, str]:
    """Judge a refusal."""
    told = f"{verdict} | {truth.why}"
    if truth.answer in {Answer.NO, Answer.UNTOLD} or truth.structure is Answer.NO:
        return Outcome.AGREED, told
    if truth.answer is Answer.OPEN:
        return (Outcome.OPEN if _SAID.search(verdict) or _LONGER.search(verdict) else Outcome.UNSAID), told
    return Outcome.MISSED, told


def allowed(truth: Truth, *, exact: bool, stated: float | None) -> float:
    """How far off an accepted observer may be on data like those of the record, relative to the largest signal."""
    most = _GROSS if exact else _NOISY
    if stated is None:
        return min(max(_EXACT, _DOUBTED * truth.doubt), most)
    told = min(10.0 * truth.doubt, _EXACT)  # what a design calls exact, where the record leaves that much open
    return min(max(_STATED * stated, told, _ROUNDED), max(most, stated))


def acceptance(
    truth: Truth,
    verdict: str,
    like: Misfit,
    full: Misfit,
    *,
    exact: bool,
    stated: float | None = None,
    decay: float = 1.0,
) -> tuple[Outcome, str]:
    """Judge an accepted observer.

    Args:
        truth: what is possible.
        verdict: of the design.
        like: on fresh data like those of the record.
        full: with every unknown input at full size.
        exact: the record holds rounding only.
        stated: the design's own figure, relative to the largest signal.
        decay: the spectral radius that was asked for.
    """
    told = f"{verdict} | fresh {like.worst:.1e} (full {full.worst:.1e}), radius {like.radius:.6g} | {truth.why}"
    if like.radius >= min(1.0, decay + _REPEATED):
        return Outcome.WRONG, f"a radius below {decay:g} was asked for: {told}"
    limit = allowed(truth, exact=exact, stated=stated)
    if like.worst > limit:
        return Outcome.WRONG, f"off on fresh data, allowed {limit:.0e}: {told}"
    if exact and full.worst > max(_GROSS, stated or 0.0):  # an input weaker than the noise nobody can find
        if truth.answer is Answer.OPEN and _SAID.search(verdict):
            return Outcome.OPEN, told
        return Outcome.WRONG, f"misses an unknown input: {told}"
    if truth.answer is Answer.NO and like.judged:
        return Outcome.DISPUTED, told
    return Outcome.RIGHT, told
