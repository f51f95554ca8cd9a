"""Does a recorded received stream still fit the history that its monitors learned from? T, definition 5, over time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bags.mcap.errors import BagError
from bags.runs.reader import open_run
from bags.watch.histories import read_histories
from bags.wire.convert import history_of
from monitor.compatibility import Compatibility, compatible

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from dgu_sim.grid import Link

__all__ = ["LinkFit", "Stretch", "check_histories"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch:
    """A part of a stream.

    Attributes:
        start_sec: Its first window begins here [s].
        misfit: Largest misfit of its windows, in shares of what is allowed; NaN where none can be judged.
    """

    start_sec: float
    misfit: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkFit:
    """Whether the stream of one link fits the history of its source.

    Attributes:
        link: From the DGU that the history is of to the one that received.
        found: What definition 5 says.
        sampling_period_sec: T_s [s].
    """

    link: Link
    found: Compatibility
    sampling_period_sec: float

    @property
    def first_sec(self) -> float | None:
        """When the first window that does not fit begins [s], None when all fit or nothing can be told."""
        return None if self.found.first is None else self.found.first * self.sampling_period_sec

    def over_time(self, every_sec: float) -> tuple[Stretch, ...]:
        """The stream in stretches of this length."""
        size = max(1, round(every_sec / self.sampling_period_sec))
        shares = self.found.misfit / np.maximum(self.found.allowed, np.finfo(float).tiny)
        return tuple(
            Stretch(
                start_sec=start * self.sampling_period_sec,
                misfit=float(np.nanmax(part)) if np.isfinite(part := shares[start : start + size]).any() else np.nan,
            )
            for start in range(0, len(shares), size)
        )

    def document(self, every_sec: float) -> dict[str, Any]:
        """JSON values; a misfit that cannot be judged is null."""
        stretches = self.over_time(every_sec)
        return {
            "link": str(self.link),
            "fits": self.found.fits,
            "verdict": self.found.verdict,
            "window": self.found.window,
            "first_sec": self.first_sec,
            "misfit": [
                {"start_sec": one.start_sec, "share": None if np.isnan(one.misfit) else one.misfit} for one in stretches
            ],
        }


def check_histories(
    path: Path, history: Path | None, link: Link | None, options: Mapping[str, object]
) -> tuple[LinkFit, ...]:
    """Hold the received outputs of a run, or of an imported stream, against the histories of their sources.

    Args:
        path: Bag of a run or of `dcmg import stream`.
        history: Bag with the histories; None: those in the bag itself.
        link: The one to judge; None: all.
        options: Of `monitor.compatibility`.

    Raises:
        BagError: A bag cannot be read, holds no such link or no history of a source: one line.
        MonitorError: An option does not fit.
    """
    run = open_run(path)
    links = run.links if link is None else tuple(one for one in run.links if one == link)
    if not links:
        raise BagError(f"{path}: holds no received stream{'' if link is None else f' of link {link}'}")
    parts: list[NDArray[np.float64]] = []
    for window in run.windows():
        y, delivered = window.arrays["received.y"], window.arrays["received.delivered"]
        parts.append(np.where(delivered[..., None].astype(bool), y, np.nan))
    received = np.concatenate(parts)
    found = []
    for one in links:
        learned = history_of(read_histories(path if history is None else history, one.source))
        y = received[:, run.links.index(one)]
        verdict = compatible(learned, np.empty((len(y), 0)), y[:, : learned.outputs], options)
        found.append(LinkFit(link=one, found=verdict, sampling_period_sec=run.topics.sampling_period_ns * 1e-9))
    return tuple(found)
