"""Live messages on the sampling grid: when it starts, how long a message is waited for, and what if clocks jump."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from bags.foreign.mapping import Mapping
from bags.foreign.sampling import Row, Sampler, SamplerState, Values

_SECOND_NS = 1_000_000_000
_PATIENCE_NS = 5 * _SECOND_NS  # the grid waits this long for the first message of every topic
_JUMP_NS = 10 * _SECOND_NS
_LATE_PERIODS = 2


class Early(NamedTuple):
    """A message from before the grid: its track, its instant and its values."""

    track: int
    stamp_ns: int
    values: Values


class LiveState(NamedTuple):
    """State of live sampling.

    Attributes:
        sampler: None before the grid has started.
        early: What came before that.
        stamp_ns: Instant of the newest message, on the clock of the stamps.
        heard_ns: When it came, on the local clock.
        first_ns: When the first message came, on the local clock.
        restarts: How often the grid started anew because the stamps jumped.
    """

    sampler: SamplerState | None = None
    early: tuple[Early, ...] = ()
    stamp_ns: int = 0
    heard_ns: int = 0
    first_ns: int = 0
    restarts: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveSampling:
    """A sampler that follows the wall clock.

    The grid starts at the first instant at which every track speaks, or with those that do after five seconds. A
    message that is `late_ns` behind the newest one, local time since then included, is not waited for any longer.
    Stamps more than ten seconds off start the grid anew.

    Attributes:
        sampler: What makes rows of messages.
        late_ns: How long a message is waited for [ns].
    """

    sampler: Sampler
    late_ns: int

    def init(self) -> LiveState:
        """Before any message."""
        return LiveState()

    def hear(self, state: LiveState, message: Early, now_ns: int) -> tuple[LiveState, Sequence[Row]]:
        """Take one message.

        Args:
            state: The state.
            message: Its track, instant and values.
            now_ns: The local clock.
        """
        newest = max(state.stamp_ns, message.stamp_ns)
        if state.sampler is None:
            first = state.first_ns if state.early else now_ns
            early = (*state.early, message)
            waiting = state._replace(early=early, stamp_ns=newest, heard_ns=now_ns, first_ns=first)
            return self._start(waiting) if len({one.track for one in early}) == self.sampler.tracks else (waiting, ())
        sampler, restarts = state.sampler, state.restarts
        if abs(message.stamp_ns - sampler.instant_ns) > _JUMP_NS + self.late_ns:
            sampler, restarts, newest = self.sampler.init(message.stamp_ns), restarts + 1, message.stamp_ns
        sampler, rows = self.sampler.push(sampler, *message)
        return state._replace(sampler=sampler, stamp_ns=newest, heard_ns=now_ns, restarts=restarts), rows

    def wait(self, state: LiveState, now_ns: int) -> tuple[LiveState, Sequence[Row]]:
        """Let time pass: what is missing for too long is missing."""
        if state.sampler is None:
            return self._start(state) if state.early and now_ns - state.first_ns > _PATIENCE_NS else (state, ())
        reached = state.stamp_ns + (now_ns - state.heard_ns) - self.late_ns
        following, rows = self.sampler.advance(state.sampler, reached)
        return state._replace(sampler=following), rows

    def _start(self, state: LiveState) -> tuple[LiveState, Sequence[Row]]:
        firsts: dict[int, int] = {}
        for track, stamp, _ in state.early:
            firsts[track] = min(stamp, firsts.get(track, stamp))
        sampler = self.sampler.init(max(firsts.values()))
        found: list[Row] = []
        for message in sorted(state.early, key=lambda one: one.stamp_ns):
            sampler, rows = self.sampler.push(sampler, *message)
            found += rows
        return state._replace(sampler=sampler, early=()), found


def live_sampling(mapping: Mapping, tracks: int, period_ns: int) -> LiveSampling:
    """Sampling as a mapping says.

    Args:
        mapping: Its `sampling` section.
        tracks: Number of topics.
        period_ns: T_s [ns].
    """
    settings = mapping.sampling
    sampler = Sampler(
        tracks=tracks,
        period_ns=period_ns,
        policy=settings.policy,
        tolerance_ns=round(settings.tolerance * period_ns),
        max_gap_ns=settings.max_gap_ns(period_ns),
    )
    return LiveSampling(sampler=sampler, late_ns=max(round(settings.late_sec * _SECOND_NS), _LATE_PERIODS * period_ns))
