"""How a bag is played and what has become of it (kept apart so that the command line need not import rclpy)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

from dcmg_nodes.punctuality import Punctuality

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dcmg_nodes.pace import Pace
    from dcmg_nodes.wiring import Wiring


@dataclass(frozen=True, slots=True, kw_only=True)
class PlayOptions:
    """How a bag is played.

    Attributes:
        rate: factor of real time; infinite: as fast as the machine goes.
        loop: start again at the end.
        paused: start paused.
        queue: messages of a topic that may be unacknowledged: what a subscriber's queue holds.
        wait_for: topics (by their names in the bag) that must have a subscriber before the first message.
        wiring: static graph of the recorded run, where nodes run on its data.
        live: names of these nodes.
        start_timeout_sec: how long to wait for subscribers and live nodes [s].
        stall_timeout_sec: how long a live node may take for a step [s].
    """

    rate: float = 1.0
    loop: bool = False
    paused: bool = False
    queue: int = 10
    wait_for: Sequence[str] = ()
    wiring: Wiring | None = None
    live: Sequence[str] = ()
    start_timeout_sec: float = 30.0
    stall_timeout_sec: float = 8.0


@dataclass(slots=True, kw_only=True)
class Played:
    """What has become of a replay.

    Attributes:
        time_sec: stamp of the last message, from where the replay started [s].
        messages: messages published.
        moments: stamps of which messages were published.
        loops: times that the end was reached.
        counts: messages published by topic (its name in the bag).
        left_out: why a topic was not published, by its name.
        between_messages: how well the times between messages were kept, while the replay ran at a finite rate.
        between_stamps: the same for the first messages of successive stamps.
        compared: equal and different messages of the live nodes, by topic.
        interrupted: it was ended before its end.
        wall_sec: time from the first message to the last [s].
    """

    time_sec: float = 0.0
    messages: int = 0
    moments: int = 0
    loops: int = 0
    counts: Mapping[str, int] = field(default_factory=dict)
    left_out: Mapping[str, str] = field(default_factory=dict)
    between_messages: Punctuality = field(default_factory=Punctuality)
    between_stamps: Punctuality = field(default_factory=Punctuality)
    compared: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    interrupted: bool = False
    wall_sec: float = 0.0


class Watcher(Protocol):
    """Whoever looks on: a terminal with keys, a supervisor of processes."""

    def say(self, line: str) -> None:
        """Tell something once."""

    def look(self, pace: Pace, played: Played) -> bool:
        """Show how far the replay is and take what it is told; False: end it."""
