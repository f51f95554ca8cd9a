"""Recordings -> rows on one sampling grid, with a report of what was found."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from bags.foreign.mapping import SamplingSettings, Signal
from bags.foreign.recordings import Recording
from bags.foreign.regularity import Regularity, detected_period_ns, regularity
from bags.foreign.sampling import Policy, Row, Sampler, SamplerState, Values
from bags.mcap.errors import BagError

_MOST_ROWS_A_MESSAGE = 1000  # more than that: the stamps jump
_REPORT_EVERY = 1000  # messages


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """Samples of consecutive instants.

    Attributes:
        period_ns: T_s [ns].
        stated: Whether the mapping stated it.
        start_ns: Instant of the first row.
        present: Whether each recording has a sample, shape (rows, recordings).
        values: Raw numbers by field, shape (rows,) each; NaN where there is none.
        tracks: Which recording a field is in.
        regularities: What the stamps of each recording say.
    """

    period_ns: int
    stated: bool
    start_ns: int
    present: NDArray[np.bool_]
    values: dict[str, NDArray[np.float64]]
    tracks: dict[str, int]
    regularities: tuple[Regularity, ...]

    def table(self, signals: Sequence[Signal]) -> NDArray[np.float64]:
        """Signals in SI units, shape (rows, signals)."""
        columns = [self.values[one.field] * one.factor + one.offset for one in signals]
        return np.stack(columns, axis=1) if columns else np.zeros((len(self.present), 0))

    def all_present(self, signals: Sequence[Signal]) -> NDArray[np.bool_]:
        """Rows in which every recording that holds one of the signals has a sample."""
        tracks = sorted({self.tracks[one.field] for one in signals})
        return np.asarray(self.present[:, tracks].all(axis=1))

    def document(self) -> dict[str, Any]:
        """For a JSON document."""
        return {
            "sampling_period_sec": self.period_ns * 1e-9,
            "sampling_period_stated": self.stated,
            "start_ns": self.start_ns,
            "rows": len(self.present),
            "rows_with_something_missing": int((~self.present.all(axis=1)).sum()),
            "recordings": [one.document() for one in self.regularities],
        }


def put_on_grid(
    source: Path,
    recordings: Sequence[Recording],
    settings: SamplingSettings,
    period_ns: int | None,
    *,
    window_sec: tuple[float, float | None] = (0.0, None),
    common: bool = True,
    progress: Callable[[int, int], None] = lambda _done, _all: None,
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
        BagError: Too few messages, no overlap in time, or the sampling is irregular and the policy refuses that.
    """
    found = _cut(source, recordings, window_sec)
    period = period_ns or _detected(source, found[0])
    looks = tuple(regularity(one.name, one.stamps_ns, one.values, period) for one in found)
    _check_rates(source, looks, settings.policy, period)
    start, end = _span(source, looks, period, common=common)
    sampler = Sampler(
        tracks=len(found),
        period_ns=period,
        policy=settings.policy,
        tolerance_ns=round(settings.tolerance * period),
        max_gap_ns=settings.max_gap_ns(period),
    )
    rows, state = _rows(sampler, found, start, end, progress)
    if settings.policy is Policy.REFUSE:
        _check_regular(source, looks, state, settings, period)
    fields = {field: track for track, one in enumerate(found) for field in one.fields}
    return Grid(
        period_ns=period,
        stated=period_ns is not None,
        start_ns=rows[0].instant_ns if rows else start,
        present=np.array([[one is not None for one in row.values] for row in rows], dtype=np.bool_).reshape(
            len(rows), len(found)
        ),
        values={field: _column(rows, track, found[track].fields.index(field)) for field, track in fields.items()},
        tracks=fields,
        regularities=looks,
    )


def _cut(source: Path, recordings: Sequence[Recording], window_sec: tuple[float, float | None]) -> list[Recording]:
    begin = min(int(one.stamps_ns.min()) for one in recordings)
    start_sec, stop_sec = window_sec
    start = begin + round(start_sec * 1e9)
    stop = 2**63 - 1 if stop_sec is None else begin + round(stop_sec * 1e9)
    found = []
    for one in recordings:
        kept = (one.stamps_ns >= start) & (one.stamps_ns < stop)
        if not kept.any():
            raise BagError(
                f"{source}: {one.name} holds no message from {start_sec:g} s to "
                f"{'the end' if stop_sec is None else f'{stop_sec:g} s'}, expected some"
            )
        found.append(
            Recording(name=one.name, fields=one.fields, stamps_ns=one.stamps_ns[kept], values=one.values[kept])
        )
    return found


def _detected(source: Path, recording: Recording) -> int:
    period = detected_period_ns(recording.stamps_ns)
    if period is None:
        raise BagError(
            f"{source}: {recording.name} holds {len(recording.stamps_ns)} messages with "
            f"{len(np.unique(recording.stamps_ns))} instants, expected two or more to detect the sampling period"
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


def _check_rates(source: Path, looks: Sequence[Regularity], policy: Policy, period_ns: int) -> None:
    """A slow topic would leave most rows without a sample."""
    for look in looks:
        if policy in {Policy.REFUSE, Policy.NEAREST} and look.period_sec * 1e9 > 1.5 * period_ns:
            raise BagError(
                f"{source}: {look.name} comes every {look.period_sec:g} s, the sampling period is {period_ns * 1e-9:g} "
                "s: expected the same, or sampling.policy hold or linear with a longer sampling.max_gap_sec"
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


def _rows(
    sampler: Sampler,
    recordings: Sequence[Recording],
    start_ns: int,
    end_ns: int,
    progress: Callable[[int, int], None],
) -> tuple[list[Row], SamplerState]:
    """All messages in the order of their stamps, through the sampler."""
    stamps = np.concatenate([one.stamps_ns for one in recordings])
    tracks = np.repeat(np.arange(len(recordings)), [len(one.stamps_ns) for one in recordings])
    indices = np.concatenate([np.arange(len(one.stamps_ns)) for one in recordings])
    order = np.argsort(stamps, kind="stable")
    values: list[list[Values]] = [[tuple(row) for row in one.values.tolist()] for one in recordings]
    state = sampler.init(start_ns)
    found: list[Row] = []
    merged = zip(stamps[order].tolist(), tracks[order].tolist(), indices[order].tolist(), strict=True)
    for number, (stamp, track, index) in enumerate(merged):
        state, rows = sampler.push(state, track, stamp, values[track][index])
        found += rows
        state, rows = sampler.advance(state, stamp)
        found += rows
        if number % _REPORT_EVERY == 0:
            progress(number, len(order))
    state, rows = sampler.advance(state, end_ns + 2 * sampler.period_ns + sampler.max_gap_ns)
    half = sampler.period_ns // 2
    kept = [row for row in [*found, *rows] if row.instant_ns <= end_ns + half]
    while kept and not any(one is not None for one in kept[-1].values):
        kept.pop()
    return kept, state


def _column(rows: Sequence[Row], track: int, position: int) -> NDArray[np.float64]:
    nothing = float("nan")
    found = ((nothing if (values := row.values[track]) is None else values[position]) for row in rows)
    return np.fromiter(found, dtype=np.float64, count=len(rows))
