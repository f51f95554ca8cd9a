"""Recordings -> rows on one sampling grid, block by block, with a report of what was found."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from heapq import merge
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bags.foreign.mapping import SamplingSettings, Signal
from bags.foreign.regularity import Regularity, detected_period_ns, regularity
from bags.foreign.sampling import Policy, Row, Sampler, SamplerState, Values
from bags.foreign.track import Recording
from bags.foreign.units import stated_factor
from bags.mcap.errors import BagError

_MOST_ROWS_A_MESSAGE = 1000  # more than that: the stamps jump
_REPORT_EVERY = 1000  # messages
_BLOCK = 1000  # rows
_AT_ONCE = 4096  # messages of a track in memory

Progress = Callable[[int, int], None]


@dataclass(frozen=True, slots=True)
class Kept:
    """Which messages of a recording count, and in which order.

    Attributes:
        numbers: Their places in the file; None: all of them, as they stand there, which takes no memory.
    """

    numbers: NDArray[np.intp] | None

    @classmethod
    def between(cls, recording: Recording, start_ns: int, stop_ns: int) -> "Kept":
        """Those with a stamp in [start, stop)."""
        stamps = recording.stamps_ns
        if len(stamps) and start_ns <= stamps.min() and stamps.max() < stop_ns:
            return cls(None)
        return cls(np.flatnonzero((stamps >= start_ns) & (stamps < stop_ns)))

    def stamps(self, recording: Recording) -> NDArray[np.int64]:
        """Their stamps [ns]."""
        return recording.stamps_ns if self.numbers is None else recording.stamps_ns[self.numbers]

    def ordered(self, recording: Recording) -> "Kept":
        """The same in the order of their stamps; those of one stamp as they stand in the file."""
        stamps = self.stamps(recording)
        if not np.any(stamps[1:] < stamps[:-1]):
            return self
        order = np.argsort(stamps, kind="stable")
        return Kept(order if self.numbers is None else self.numbers[order])

    def parts(self, recording: Recording, most: int) -> Iterator[NDArray[np.intp]]:
        """Their places, at most so many at a time."""
        count = len(recording.stamps_ns) if self.numbers is None else len(self.numbers)
        for start in range(0, count, most):
            stop = min(start + most, count)
            yield np.arange(start, stop) if self.numbers is None else self.numbers[start:stop]


@dataclass(frozen=True, slots=True, kw_only=True)
class Samples:
    """Samples of consecutive instants.

    Attributes:
        first_ns: Instant of the first row [ns].
        present: Whether each track has a sample, shape (rows, tracks).
        values: Raw numbers of each field, shape (rows, fields); NaN where there is none.
        fields: Names of the fields.
        tracks: In which track each field is.
        units: Unit of each field as its file states it, "" where it does not.
    """

    first_ns: int
    present: NDArray[np.bool_]
    values: NDArray[np.float64]
    fields: tuple[str, ...]
    tracks: tuple[int, ...]
    units: tuple[str, ...]

    def table(self, signals: Sequence[Signal]) -> NDArray[np.float64]:
        """Signals in SI units, shape (rows, signals)."""
        found = np.empty((len(self.values), len(signals)))
        for position, one in enumerate(signals):
            place = self.fields.index(one.field)
            factor = one.factor * (stated_factor(self.units[place]) if one.is_bare else 1.0)
            found[:, position] = self.values[:, place] * factor + one.offset
        return found

    def delivered(self, signals: Sequence[Signal]) -> NDArray[np.bool_]:
        """Rows in which every one of the signals has a sample, and each is a finite number: anything else is none."""
        places = [self.fields.index(one.field) for one in signals]
        tracks = sorted({self.tracks[place] for place in places})
        finite = np.isfinite(self.values[:, places]).all(axis=1)
        return np.asarray(self.present[:, tracks].all(axis=1) & finite, dtype=np.bool_)


@dataclass(slots=True, kw_only=True)
class Grid:
    """Recordings on their way onto a grid: `blocks` is gone through once, and what it found is told afterwards.

    Attributes:
        source: What to call the recordings in messages.
        period_ns: T_s [ns].
        stated: Whether the mapping stated it.
        regularities: What the stamps of each recording say.
        rows: Rows so far.
        incomplete: Those among them in which something is missing.
        not_finite: Samples of each field so far that are no finite numbers, those that are missing not counted.
        start_ns: Instant of the first row [ns].
    """

    source: Path
    period_ns: int
    stated: bool
    regularities: tuple[Regularity, ...]
    settings: SamplingSettings
    rows: int = 0
    incomplete: int = 0
    not_finite: dict[str, int] = field(default_factory=dict)
    start_ns: int = 0
    _recordings: tuple[Recording, ...] = field(repr=False)
    _kept: tuple[Kept, ...] = field(repr=False)
    _span: tuple[int, int] = field(repr=False)
    _progress: Progress = field(repr=False)

    def blocks(self) -> Iterator[Samples]:
        """All rows, at most a thousand at a time; the last ones in which nothing is present are left out.

        Raises:
            BagError: The sampling is irregular and the policy refuses that: behind the last block.
        """
        sampler = Sampler(
            tracks=len(self._recordings),
            period_ns=self.period_ns,
            policy=self.settings.policy,
            tolerance_ns=round(self.settings.tolerance * self.period_ns),
            max_gap_ns=self.settings.max_gap_ns(self.period_ns),
        )
        waiting: list[Row] = []
        last = 0  # rows up to the last one in which something is present
        states = [sampler.init(self._span[0])]
        for row in self._rows(sampler, states):
            waiting.append(row)
            if any(one is not None for one in row.values):
                last = len(waiting)
            if last >= _BLOCK:
                yield self._samples(waiting[:last])
                waiting, last = waiting[last:], 0
        if last:
            yield self._samples(waiting[:last])
        self._kept = ()
        self._recordings = ()  # of no more use, and as long as the recording
        if self.settings.policy is Policy.REFUSE:
            _check_regular(self.source, self.regularities, states[0], self.settings, self.period_ns)

    def document(self) -> dict[str, Any]:
        """For a JSON document."""
        return {
            "sampling_period_sec": self.period_ns * 1e-9,
            "sampling_period_stated": self.stated,
            "start_ns": self.start_ns,
            "rows": self.rows,
            "rows_with_something_missing": self.incomplete,
            "not_finite": dict(self.not_finite),
            "recordings": [one.document() for one in self.regularities],
        }

    def _rows(self, sampler: Sampler, states: list[SamplerState]) -> Iterator[Row]:
        """All messages in the order of their stamps, through the sampler; the state is left in the list."""
        state = states[0]
        total = sum(one.messages for one in self.regularities)
        streams = [
            _messages(track, one, kept)
            for track, (one, kept) in enumerate(zip(self._recordings, self._kept, strict=True))
        ]
        latest = self._span[1] + self.period_ns // 2
        before: int | None = None
        for number, (stamp, track, _, values) in enumerate(merge(*streams)):
            if stamp != before:
                state, rows = sampler.advance(state, stamp)
                yield from (row for row in rows if row.instant_ns <= latest)
                before = stamp
            state, rows = sampler.push(state, track, stamp, values)
            yield from (row for row in rows if row.instant_ns <= latest)
            if number % _REPORT_EVERY == 0:
                self._progress(number, total)
        state, rows = sampler.advance(state, self._span[1] + 2 * sampler.period_ns + sampler.max_gap_ns)
        states[0] = state
        yield from (row for row in rows if row.instant_ns <= latest)

    def _samples(self, rows: Sequence[Row]) -> Samples:
        fields = tuple(name for one in self._recordings for name in one.fields)
        tracks = tuple(track for track, one in enumerate(self._recordings) for _ in one.fields)
        values = np.full((len(rows), len(fields)), np.nan)
        present = np.zeros((len(rows), len(self._recordings)), dtype=np.bool_)
        widths = [len(one.fields) for one in self._recordings]
        starts = np.concatenate([[0], np.cumsum(widths)]).tolist()
        for number, row in enumerate(rows):
            for track, found in enumerate(row.values):
                if found is not None:
                    present[number, track] = True
                    values[number, starts[track] : starts[track + 1]] = found
        finite = np.isfinite(values)
        if not self.rows and rows:
            self.start_ns = rows[0].instant_ns
        self.rows += len(rows)
        self.incomplete += int((~finite.all(axis=1)).sum())
        for place, name in enumerate(fields):
            odd = int((present[:, tracks[place]] & ~finite[:, place]).sum())
            if odd:
                self.not_finite[name] = self.not_finite.get(name, 0) + odd
        return Samples(
            first_ns=rows[0].instant_ns if rows else 0,
            present=present,
            values=values,
            fields=fields,
            tracks=tracks,
            units=tuple(one.unit_of(name) for one in self._recordings for name in one.fields),
        )


def put_on_grid(
    source: Path,
    recordings: Sequence[Recording],
    settings: SamplingSettings,
    period_ns: int | None,
    *,
    window_sec: tuple[float, float | None] = (0.0, None),
    common: bool = True,
    progress: Progress = lambda _done, _all: None,
) -> Grid:
    """Sample recordings together.

    Args:
        source: What to call them in messages.
        recordings: The first one sets the pace.
        settings: Policy and tolerances.
        period_ns: T_s, None: detected.
        window_sec: Part of the recordings, since their first message.
        common: Only while all recordings speak, else while any one does.
        progress: Called with how many messages are sampled and how many there are.

    Raises:
        BagError: Too few messages, or no overlap in time.
    """
    kept = _cut(source, recordings, window_sec)
    first = recordings[0]
    period = period_ns or _detected(source, first.name, kept[0].stamps(first))
    # what is bridged may come more slowly than the grid
    expected = period if settings.policy in {Policy.REFUSE, Policy.NEAREST} else None
    looks = tuple(
        regularity(one.name, rows.stamps(one), one.values, expected, rows.numbers)
        for one, rows in zip(recordings, kept, strict=True)
    )
    _check_rates(source, looks, settings, period)
    return Grid(
        source=source,
        period_ns=period,
        stated=period_ns is not None,
        regularities=looks,
        settings=settings,
        _recordings=tuple(recordings),
        _kept=tuple(rows.ordered(one) for one, rows in zip(recordings, kept, strict=True)),
        _span=_span(source, looks, period, common=common),
        _progress=progress,
    )


def _messages(track: int, recording: Recording, kept: Kept) -> Iterator[tuple[int, int, int, Values]]:
    """Stamp, track, number and values of the messages of a track in the order of their stamps."""
    number = 0
    for rows in kept.parts(recording, _AT_ONCE):
        stamps = recording.stamps_ns[rows].tolist()
        for stamp, values in zip(stamps, recording.values[rows].tolist(), strict=True):
            yield stamp, track, number, tuple(values)
            number += 1


def _cut(source: Path, recordings: Sequence[Recording], window_sec: tuple[float, float | None]) -> list[Kept]:
    """Which messages of each recording are in the window."""
    begin = min(int(one.stamps_ns.min()) for one in recordings)
    start_sec, stop_sec = window_sec
    start = begin + round(start_sec * 1e9)
    stop = 2**63 - 1 if stop_sec is None else begin + round(stop_sec * 1e9)
    found = []
    for one in recordings:
        kept = Kept.between(one, start, stop)
        if kept.numbers is not None and not len(kept.numbers):
            raise BagError(
                f"{source}: {one.name} holds no message from {start_sec:g} s to "
                f"{'the end' if stop_sec is None else f'{stop_sec:g} s'}, expected some"
            )
        found.append(kept)
    return found


def _detected(source: Path, name: str, stamps_ns: NDArray[np.int64]) -> int:
    period = detected_period_ns(stamps_ns)
    if period is None:
        raise BagError(
            f"{source}: {name} holds {len(stamps_ns)} messages with {len(np.unique(stamps_ns))} instants, expected two "
            "or more to detect the sampling period"
        )
    return period


def _span(source: Path, looks: Sequence[Regularity], period_ns: int, *, common: bool) -> tuple[int, int]:
    """First and last instant [ns] of the common time, or of all of it."""
    first, last = max(looks, key=lambda one: one.start_ns), min(looks, key=lambda one: one.end_ns)
    if first.start_ns > last.end_ns:
        gap_sec = (first.start_ns - last.end_ns) * 1e-9
        raise BagError(
            f"{source}: no overlap in time, {first.name} begins {gap_sec:g} s after the end of {last.name}: "
            "record them together, or see key stamps for the clock that counts"
        )
    start = first.start_ns if common else min(one.start_ns for one in looks)
    end = last.end_ns if common else max(one.end_ns for one in looks)
    messages = sum(one.messages for one in looks)
    if (end - start) // period_ns > _MOST_ROWS_A_MESSAGE * messages:
        raise BagError(
            f"{source}: {messages} messages in {(end - start) * 1e-9:g} s, expected about one each "
            f"{period_ns * 1e-9:g} s: do the stamps jump?"
        )
    return start, end


def _check_rates(source: Path, looks: Sequence[Regularity], settings: SamplingSettings, period_ns: int) -> None:
    """A slow topic would leave most rows without a sample."""
    bridged = settings.max_gap_ns(period_ns)
    for look in looks:
        if settings.policy in {Policy.REFUSE, Policy.NEAREST}:
            if look.period_sec * 1e9 > 1.5 * period_ns:
                raise BagError(
                    f"{source}: {look.name} comes every {look.period_sec:g} s, the sampling period is "
                    f"{period_ns * 1e-9:g} s: expected the same, or sampling.policy hold or linear with a longer "
                    "sampling.max_gap_sec"
                )
        elif look.period_sec * 1e9 > bridged:
            raise BagError(
                f"{source}: {look.name} comes every {look.period_sec:g} s, {settings.policy.value} bridges at most "
                f"{bridged * 1e-9:g} s: expected sampling.max_gap_sec (--max-gap) of {look.period_sec:g} or more"
            )


def _check_regular(
    source: Path, looks: Sequence[Regularity], state: SamplerState, settings: SamplingSettings, period_ns: int
) -> None:
    for look in looks:
        if look.conflicting:
            raise BagError(
                f"{source}: {look.conflicting} messages on {look.name} repeat a stamp with other values, expected one "
                "message an instant: choose a sampling.policy other than refuse to take the first one"
            )
    if state.example is None:
        return
    look = looks[state.example.track]
    raise BagError(
        f"{source}: irregular sampling, {state.irregular} messages are more than {settings.tolerance:.0%} of "
        f"{period_ns * 1e-9:g} s off, the first one on {look.name} by {state.example.off_ns * 1e-9:g} s at "
        f"{(state.example.stamp_ns - look.start_ns) * 1e-9:g} s: choose sampling.policy nearest, hold or linear, or "
        "another sampling.tolerance"
    )
