"""The last word of every public design: a step that failed numerically is a refusal, not an exception."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from monitor.errors import MonitorError

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import TracebackType

Made = TypeVar("Made")
_NUMERICAL = (np.linalg.LinAlgError, ArithmeticError)
_SOLVERS = "SolverError"  # of cvxpy, known by name: loading it takes a second
_UNBOUNDED = re.compile(r"\bnans?\b|\binfs?\b|infinity|finite", re.IGNORECASE)  # ValueErrors of numpy, scipy and cvxpy


def guarded(work: Callable[[], Made], refuse: Callable[[str], Made]) -> Made:
    """Return what work makes, or a refusal that says which step failed numerically and what would help.

    Any other exception is misuse or a mistake of ours and goes on.

    Args:
        work: the design, its options checked.
        refuse: makes the refusal from its reason.
    """
    try:
        return work()
    except MonitorError:
        raise
    except Exception as error:
        if not _numerical(error):
            raise
        return refuse(
            f"the numbers leave double precision in the step {_step(error.__traceback__)} "
            f"({' '.join(str(error).split())}): excite every signal, record longer, or check for outliers"
        )


def _numerical(error: Exception) -> bool:
    if isinstance(error, _NUMERICAL) or type(error).__name__ == _SOLVERS:
        return True
    return isinstance(error, ValueError) and bool(_UNBOUNDED.search(str(error)))


def _step(trace: TracebackType | None) -> str:
    """Name the innermost function of this package that was at work, with its module."""
    package, found = __name__.partition(".")[0], "design"
    while trace is not None:
        module = str(trace.tb_frame.f_globals.get("__name__", ""))
        if module.partition(".")[0] == package and module != __name__:
            found = f"{module.partition('.')[2]}.{trace.tb_frame.f_code.co_name.strip('_')}"
        trace = trace.tb_next
    return found
