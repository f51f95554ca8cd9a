"""What the options of `dcmg replay --publish` come to."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from bags.mcap.recording import TopicFilter

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from bags.sources.recorded import Known


@dataclass(frozen=True, slots=True, kw_only=True)
class PublishOptions:
    """How a bag is published; see `bags.runs.playback.Selection` and `dcmg_nodes.player.PlayOptions`.

    Attributes:
        monitors: start the monitor nodes of the run on the published data.
        attached: nodes that somebody else starts on it.
        domain: ROS domain id, None: a free one for monitors of our own, else that of the environment.
        known: definitions of types that the bag does not define itself.
        out: folder for the logs of the monitors, None: a new one below `out`.
    """

    known: Known
    rate: float = 1.0
    start_offset_sec: float = 0.0
    duration_sec: float | None = None
    loop: bool = False
    paused: bool = False
    topics: TopicFilter = field(default_factory=TopicFilter)
    remap: dict[str, str] = field(default_factory=dict)
    wait_for: Sequence[str] = ()
    queue: int = 10
    monitors: bool = False
    attached: Sequence[str] = ()
    domain: int | None = None
    out: Path | None = None
