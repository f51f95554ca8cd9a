"""All trials by name, with the share of the time that each gets."""

from __future__ import annotations

import signal
import traceback
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from tests.fuzz.estimators import try_estimator
from tests.fuzz.judge import Outcome, Result
from tests.fuzz.local_module import try_local
from tests.fuzz.observers import try_observer
from tests.fuzz.teams import try_distributed, try_team
from tests.fuzz.windows import try_windows

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import FrameType

_LONGEST_SEC = 20.0  # of a design and its judgement


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """How a kind is tried.

    Attributes:
        attempt: designs, runs and judges one case.
        share: cases of it in a round.
    """

    attempt: Callable[[str, int], Result]
    share: int


TRIALS: dict[str, Trial] = {
    "full_order/minimum_norm": Trial(attempt=try_observer, share=12),
    "full_order/dual_lqr": Trial(attempt=try_observer, share=12),
    "full_order/pole_placement": Trial(attempt=try_observer, share=8),
    "full_order/max_sensitivity": Trial(attempt=try_observer, share=1),
    "reduced_order/minimum_norm": Trial(attempt=try_observer, share=12),
    "reduced_order/dual_lqr": Trial(attempt=try_observer, share=8),
    "reduced_order/pole_placement": Trial(attempt=try_observer, share=6),
    "reduced_order/max_sensitivity": Trial(attempt=try_observer, share=1),
    "delayed/exact": Trial(attempt=try_observer, share=12),
    "delayed/best": Trial(attempt=try_observer, share=2),
    "delayed/bounded": Trial(attempt=try_observer, share=1),
    "uie/observer/op_uie": Trial(attempt=try_windows, share=4),
    "uie/observer/cl_uie": Trial(attempt=try_windows, share=4),
    "uie/estimator/op_uie": Trial(attempt=try_windows, share=4),
    "uie/estimator/cl_uie": Trial(attempt=try_windows, share=4),
    "inputs/one_step": Trial(attempt=try_estimator, share=6),
    "inputs/delayed": Trial(attempt=try_estimator, share=6),
    "local": Trial(attempt=try_local, share=6),
    "distributed/sampled": Trial(attempt=try_distributed, share=2),
    "distributed/continuous": Trial(attempt=try_distributed, share=4),
    "team": Trial(attempt=try_team, share=1),
}


def judged(kind: str, seed: int) -> Result:
    """Try one case; an exception or an endless design is an outcome, too."""
    before = signal.signal(signal.SIGPROF, _too_long)
    signal.setitimer(signal.ITIMER_PROF, _LONGEST_SEC)  # of CPU time: another program's load is no fault of ours
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of numpy about what the judgement shows anyway
        try:
            return TRIALS[kind].attempt(kind, seed)
        except Exception as error:
            where = traceback.extract_tb(error.__traceback__)
            own = [one for one in where if "/monitor/" in one.filename and "/tests/" not in one.filename]
            if not own:
                raise
            place = f"{Path(own[-1].filename).name}:{own[-1].lineno} {own[-1].name}"
            detail = " ".join(f"{type(error).__name__}: {error} ({place})".split())
            return Result(kind=kind, seed=seed, outcome=Outcome.EXCEPTION, detail=detail)
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0.0)
            signal.signal(signal.SIGPROF, before)


def _too_long(number: int, frame: FrameType | None) -> None:
    del number, frame
    raise TimeoutError(f"more than {_LONGEST_SEC:g} s of CPU time")
