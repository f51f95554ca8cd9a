"""How the nodes of a process run (kept apart so that the command line need not import rclpy)."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING

from bags.mcap.recording import Recording

if TYPE_CHECKING:
    from pathlib import Path

BAG = "bag"  # folder of the bag below the folder of the run
STRANGERS = "strangers"  # folder beside it: what was said on the run's topics by others
STRANGERS_SUMMARY = "summary.json"  # in that folder
GATE = "gate"


class PacingMode(Enum):
    """When the clock releases a step."""

    LOCKSTEP = "lockstep"
    REALTIME = "realtime"


class ExecutorKind(Enum):
    """Which rclpy executor runs the callbacks."""

    EVENTS = "events"
    SINGLE = "single"


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeOptions:
    """How the nodes of a process run.

    Attributes:
        out: folder of the run; the recorder writes `<out>/bag`.
        pacing: when the clock releases a step.
        rate: realtime factor of the clock.
        executor: rclpy executor.
        start_timeout_sec: how long the clock waits for all nodes [s].
        stall_timeout_sec: how long a step may stay incomplete [s].
        recording: how the recorder writes its bag.
        designs: bag with designs that the monitors take where they fit, None: they design everything.
        alone: whether no supervisor looks after the processes, so that they look after each other.
        run: which run it is, if its scenario names files that lie elsewhere here; empty: the scenario tells.
    """

    out: Path
    pacing: PacingMode = PacingMode.LOCKSTEP
    rate: float = 1.0
    executor: ExecutorKind = ExecutorKind.EVENTS
    start_timeout_sec: float = 30.0
    stall_timeout_sec: float = 8.0
    recording: Recording = field(default_factory=Recording)
    designs: Path | None = None
    alone: bool = False
    run: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class GateOptions:
    """Where the gate stands.

    Attributes:
        inner: ROS domain id of the nodes.
        public: ROS domain id of everybody else.
        folder: where to keep what strangers say.
        profile: of Fast DDS, None: that of a run on one host.
        peers: addresses of the other hosts.
    """

    inner: int
    public: int
    folder: Path
    profile: Path | None = None
    peers: tuple[str, ...] = ()
