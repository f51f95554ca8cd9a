"""What can accuse a link. A new source of alarms is one entry of `SOURCES`: reports measure it beside the others."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from bags.run_record import RunRecord

MAIN = "residual"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmSource:
    """One way to accuse links.

    Attributes:
        title: For people.
        of: Alarms of a window, shape (steps, links); None when the run has no such source.
    """

    title: str
    of: Callable[[RunRecord], NDArray[np.bool_] | None]


SOURCES: Mapping[str, AlarmSource] = {
    MAIN: AlarmSource(title="residual of the link's observer", of=lambda window: window.alarm),
}
