"""Messages that come when they come -> one row of values a sampling period.

One object does it for recorded and for live messages, so both give the same rows. A row is given as soon as every
track (a topic, or a table) is decided for its instant, and what is decided depends on the messages alone, not on when
they are told.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple, TypeAlias

Values: TypeAlias = tuple[float, ...]

_TRACKING = 64  # the grid follows 1/64 of the deviation: clocks that drift are followed, jitter is averaged


class Policy(Enum):
    """What stands for the sample at an instant t_k of the grid."""

    REFUSE = "refuse"  # the message at t_k, within the tolerance; the grid follows the messages
    NEAREST = "nearest"  # the message nearest to t_k, at most half a period away
    HOLD = "hold"  # the last message up to t_k, at most max_gap old
    LINEAR = "linear"  # the straight line between the messages around t_k, at most max_gap apart


_MATCHING = frozenset({Policy.REFUSE, Policy.NEAREST})  # each message belongs to one instant


class Message(NamedTuple):
    """One message of a track: its instant [ns] and its values."""

    stamp_ns: int
    values: Values


class Irregular(NamedTuple):
    """A message that is at no instant of the grid: its track, its instant and how far it is off [ns]."""

    track: int
    stamp_ns: int
    off_ns: int


class Row(NamedTuple):
    """One sample.

    Attributes:
        instant_ns: t_k [ns].
        values: Of each track, None where it has no sample.
    """

    instant_ns: int
    values: tuple[Values | None, ...]


class Track(NamedTuple):
    """What is known of one track.

    Attributes:
        waiting: Messages that may still be needed, ascending.
        heard_ns: No message before this instant will come any more.
    """

    waiting: tuple[Message, ...]
    heard_ns: int


class SamplerState(NamedTuple):
    """State of a sampler.

    Attributes:
        start_ns: Where the first row was expected.
        instant_ns: Where the next row is expected.
        first_missing: The first track has no sample in the row before: its next message sets the grid anew.
        tracks: The tracks.
        repeated: Messages dropped because their stamp is that of the one before.
        late: Messages dropped because their stamp is before that of an earlier one, or their row is gone.
        irregular: How many messages are at no instant of the grid (policy refuse).
        example: The first of them.
    """

    start_ns: int
    instant_ns: int
    first_missing: bool
    tracks: tuple[Track, ...]
    repeated: int = 0
    late: int = 0
    irregular: int = 0
    example: Irregular | None = None


class _Choice(NamedTuple):
    """Decision on one track: values or None, its instant, how many waiting messages are done, one off the grid."""

    values: Values | None
    stamp_ns: int | None
    done: int
    off: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Sampler:
    """Puts tracks on the grid t_0, t_0 + T_s, ...

    The first track sets the pace: with `refuse` the next instant is T_s behind its last message, with `nearest` the
    grid follows it slowly. With `hold` and `linear` the grid is uniform.

    Attributes:
        tracks: How many.
        period_ns: T_s [ns].
        policy: What stands for a sample.
        tolerance_ns: How far a message may be off (refuse), or come behind t_k and still count as before it (hold).
        max_gap_ns: Longest time that `hold` holds and `linear` bridges.
    """

    tracks: int
    period_ns: int
    policy: Policy
    tolerance_ns: int
    max_gap_ns: int

    def init(self, start_ns: int) -> SamplerState:
        """Before any message; the first row is at `start_ns`."""
        return SamplerState(start_ns, start_ns, first_missing=True, tracks=(Track((), -(2**63)),) * self.tracks)

    def push(
        self, state: SamplerState, track: int, stamp_ns: int, values: Values
    ) -> tuple[SamplerState, Sequence[Row]]:
        """Take one message.

        Args:
            state: The state.
            track: Number of its track.
            stamp_ns: When it was measured.
            values: What it says.
        """
        if self.policy in _MATCHING and stamp_ns < state.start_ns - self.period_ns // 2:
            return state, ()
        waiting, heard = state.tracks[track]
        if stamp_ns < heard:
            if waiting and waiting[-1].stamp_ns == stamp_ns:
                return state._replace(repeated=state.repeated + 1), ()
            return state._replace(late=state.late + 1), ()
        following = Track((*waiting, Message(stamp_ns, values)), stamp_ns + 1)
        return self._settle(_with_track(state, track, following))

    def advance(self, state: SamplerState, stamp_ns: int) -> tuple[SamplerState, Sequence[Row]]:
        """No message before this instant will come any more on any track."""
        tracks = tuple(Track(waiting, max(heard, stamp_ns)) for waiting, heard in state.tracks)
        return self._settle(state._replace(tracks=tracks))

    def _settle(self, state: SamplerState) -> tuple[SamplerState, Sequence[Row]]:
        rows: list[Row] = []
        while (found := self._row(state)) is not None:
            state, row = found
            rows.append(row)
        return state, rows

    def _row(self, state: SamplerState) -> tuple[SamplerState, Row] | None:
        """The row at the next instant, None while a track is undecided."""
        instant = state.instant_ns
        if self.policy is Policy.REFUSE:
            first = self._at_instant(state.tracks[0], instant, self._reach(first=state.first_missing))
            if first is not None and first.stamp_ns is not None:
                instant = first.stamp_ns
        choices: list[_Choice] = []
        for number, track in enumerate(state.tracks):
            choice = first if self.policy is Policy.REFUSE and number == 0 else self._choice(track, instant)
            if choice is None:
                return None
            choices.append(choice)
        tracks = tuple(
            Track(track.waiting[choice.done :], track.heard_ns)
            for track, choice in zip(state.tracks, choices, strict=True)
        )
        following = state._replace(
            instant_ns=self._next(instant, choices[0]), first_missing=choices[0].values is None, tracks=tracks
        )
        return self._noted(following, choices, state), Row(instant, tuple([one.values for one in choices]))

    def _next(self, instant: int, first: _Choice) -> int:
        if self.policy is Policy.NEAREST and first.stamp_ns is not None:
            return instant + self.period_ns + (first.stamp_ns - instant) // _TRACKING
        return instant + self.period_ns

    def _reach(self, *, first: bool) -> int:
        return self.period_ns // 2 if first else self.tolerance_ns

    def _choice(self, track: Track, instant: int) -> _Choice | None:
        if self.policy is Policy.REFUSE:
            return self._at_instant(track, instant, self.tolerance_ns)
        if self.policy is Policy.NEAREST:
            return self._nearest(track, instant)
        return self._held(track, instant) if self.policy is Policy.HOLD else self._between(track, instant)

    def _at_instant(self, track: Track, instant: int, reach: int) -> _Choice | None:
        """The message within reach of an instant; others in its period are off the grid."""
        half = self.period_ns // 2
        off = 0
        for position, (stamp, values) in enumerate(track.waiting):
            if abs(stamp - instant) <= reach:
                return _Choice(values, stamp, position + 1, off)
            if stamp > instant + half:
                return _Choice(None, None, position, off)
            off += 1
        return _Choice(None, None, off, off) if track.heard_ns > instant + half else None

    def _nearest(self, track: Track, instant: int) -> _Choice | None:
        half = self.period_ns // 2
        before = sum(1 for stamp, _ in track.waiting if stamp <= instant)
        earlier = track.waiting[before - 1] if before else None
        if earlier is not None and instant - earlier.stamp_ns > half:
            earlier = None
        nearer_than = half + 1 if earlier is None else instant - earlier.stamp_ns
        later = track.waiting[before] if before < len(track.waiting) else None
        if later is not None and later.stamp_ns - instant < nearer_than:
            return _Choice(later.values, later.stamp_ns, before + 1)
        if later is None and track.heard_ns < instant + nearer_than:
            return None
        return _Choice(None, None, before) if earlier is None else _Choice(earlier.values, earlier.stamp_ns, before)

    def _held(self, track: Track, instant: int) -> _Choice | None:
        if track.heard_ns <= instant + self.tolerance_ns:
            return None
        before = sum(1 for stamp, _ in track.waiting if stamp <= instant + self.tolerance_ns)
        if not before:
            return _Choice(None, None, 0)
        stamp, values = track.waiting[before - 1]
        return _Choice(values if instant - stamp <= self.max_gap_ns else None, stamp, before - 1)

    def _between(self, track: Track, instant: int) -> _Choice | None:
        before = sum(1 for stamp, _ in track.waiting if stamp <= instant)
        earlier = track.waiting[before - 1] if before else None
        if earlier is not None and earlier.stamp_ns == instant:
            return _Choice(earlier.values, instant, before - 1)
        later = track.waiting[before] if before < len(track.waiting) else None
        if later is None:
            reached = instant if earlier is None else max(instant, earlier.stamp_ns + self.max_gap_ns)
            return _Choice(None, None, max(before - 1, 0)) if track.heard_ns > reached else None
        if earlier is None or later.stamp_ns - earlier.stamp_ns > self.max_gap_ns:
            return _Choice(None, None, max(before - 1, 0))
        share = (instant - earlier.stamp_ns) / (later.stamp_ns - earlier.stamp_ns)
        pairs = zip(earlier.values, later.values, strict=True)
        return _Choice(tuple([a + share * (b - a) for a, b in pairs]), instant, before - 1)

    def _noted(self, state: SamplerState, choices: Sequence[_Choice], before: SamplerState) -> SamplerState:
        """Count the messages that are at no instant of the grid."""
        off = sum(choice.off for choice in choices)
        if not off:
            return state
        example = state.example
        if example is None:
            number = next(number for number, choice in enumerate(choices) if choice.off)
            stamp = before.tracks[number].waiting[0].stamp_ns  # those off the grid stand before the one that is on it
            distance = stamp - before.instant_ns
            example = Irregular(number, stamp, (distance + self.period_ns // 2) % self.period_ns - self.period_ns // 2)
        return state._replace(irregular=state.irregular + off, example=example)


def _with_track(state: SamplerState, number: int, track: Track) -> SamplerState:
    return state._replace(tracks=(*state.tracks[:number], track, *state.tracks[number + 1 :]))
