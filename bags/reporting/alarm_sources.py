"""What can accuse a link. A new source of alarms is one entry of `SOURCES`: reports measure it beside the others."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from bags.runs.run_record import RunRecord
from bags.wire.stream import Spoofed
from dgu_sim.grid import Link

MAIN = "residual"
VERDICT = "verdict"

Judge: TypeAlias = Callable[[RunRecord], NDArray[np.bool_] | None]
"""Alarms of a window, shape (steps, links); None when the run has no such source. Windows come in their order."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmSource:
    """One way to accuse links.

    Attributes:
        title: For people.
        start: A judge of a run with these links, before its first window.
    """

    title: str
    start: Callable[[Sequence[Link]], Judge]


def _stream(links: Sequence[Link]) -> Judge:
    spoofed = Spoofed(links=links)

    def judge(window: RunRecord) -> NDArray[np.bool_]:
        found = np.zeros((window.steps, len(links)), dtype=np.bool_)
        for row, positions in spoofed.rows(window.streams, window.first_step, window.steps).items():
            found[row, positions] = True
        return found

    return judge


def _plausibility(window: RunRecord) -> NDArray[np.bool_] | None:
    inputs = None if window.combined is None else window.combined.inputs
    return None if inputs is None else inputs.alarm


def _team(window: RunRecord) -> NDArray[np.bool_] | None:
    dgus = window.topics.dgus
    if window.told is None or window.told.alarm.shape[1:] != (len(dgus), len(dgus)):
        return None
    pairs = [(dgus.index(link.target), dgus.index(link.source)) for link in window.links]
    return np.stack([window.told.alarm[:, hearer, told] for hearer, told in pairs], axis=1)


SOURCES: Mapping[str, AlarmSource] = {
    VERDICT: AlarmSource(
        title="verdict on everything below",
        start=lambda _: lambda window: None if window.combined is None else window.combined.verdict.accused,
    ),
    MAIN: AlarmSource(title="residual of the link's observer", start=lambda _: lambda window: window.alarm),
    "plausibility": AlarmSource(title="plausibility of the reconstructed input", start=lambda _: _plausibility),
    "local": AlarmSource(
        title="own state, isolated",
        start=lambda _: lambda window: None if window.combined is None else window.combined.verdict.by_local,
    ),
    "stream": AlarmSource(title="guard of the stream", start=_stream),
    "missing": AlarmSource(title="samples that did not arrive", start=lambda _: lambda window: ~window.delivered),
    "team": AlarmSource(title="team: the member's estimate disagrees", start=lambda _: _team),
}
