"""The team's part of a run without ROS, and of a replay."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bags.mcap.topic import Topic
from bags.mcap.writer import BagWriter
from bags.runs.run_record import RunRecord
from bags.watch.team import RunTeam
from bags.watch.team_record import TeamArrays, TeamRecord, accusation_changes
from bags.wire.arrays import grouped
from bags.wire.records import AlarmRecord, HistoryRecord
from dgu_sim.simulate import Block
from monitor.team import MemberOutput


@dataclass(slots=True, kw_only=True)
class TeamProgress:
    """A team that is stepped through a run window by window.

    Attributes:
        team: The team.
        histories: What it was designed from.
        told: What came last; None before the first window.
    """

    team: RunTeam
    histories: tuple[HistoryRecord, ...]
    told: TeamArrays | None = None
    _before: Any = None

    def take(
        self, y: NDArray[np.float64], received: NDArray[np.float64], inputs: NDArray[np.float64]
    ) -> tuple[TeamArrays, list[tuple[int, int, int]]]:
        """Take the steps of a window; what was told, and which accusations started or ended (see `RunTeam.run`)."""
        before = self.team.init() if self._before is None else self._before
        earlier = before[1].alarm[-1]
        if not len(y):
            return TeamArrays.empty(self.team.topics, 0), []
        self._before, self.told = self.team.run(before, y, received, inputs)
        return self.told, accusation_changes(self.told.alarm, earlier)


def write_team_documents(writer: BagWriter, progress: TeamProgress) -> None:
    """Write what stands before step 0."""
    history = progress.team.topics.grid_history()
    for record in progress.histories:
        writer.write(history.topic.name, 0, history.encode(record))
    for codec, design in progress.team.messages():
        writer.write(codec.topic.name, 0, codec.encode(design))


def team_arrays(
    progress: TeamProgress, block: Block, events: dict[int, list[tuple[Topic, bytes]]]
) -> dict[str, NDArray[Any]]:
    """Step the team through a block; what is told, by the names of the table. Its accusations go to the events."""
    topics = progress.team.topics
    told, changes = progress.take(block.y[:, 0], block.received[:, 0], _announced(progress.team, block))
    for row, member, accused in changes:
        codec = topics.accusations(topics.dgus[member])
        output = told.accusation(row, member, accused)
        data = codec.encode(block.first_step + row, topics.dgus[accused], output)
        events.setdefault(row, []).append((codec.topic, data))
    return told_arrays(told)


def told_arrays(told: TeamArrays) -> dict[str, NDArray[Any]]:
    """What the members told and the DGUs announced, by the names of the table."""
    announced = {"announced.load_current": told.inputs[..., 0], "announced.reference": told.inputs[..., 1]}
    return announced | grouped("estimate", {name: getattr(told, name) for name in MemberOutput._fields})


def replayed_team(progress: TeamProgress, window: RunRecord) -> tuple[TeamArrays, TeamRecord]:
    """Step the team through a window of a recorded run."""
    assert window.told is not None  # noqa: S101 - the replay has made sure of it
    told, changes = progress.take(window.y, window.received, window.told.inputs)
    dgus = progress.team.topics.dgus
    record = TeamRecord(
        designs={member: progress.team.record(member) for member in dgus},
        alarms=tuple(_alarm(window.first_step, change, told, dgus) for change in changes),
        histories=progress.histories,
    )
    return told, record


def _alarm(first_step: int, change: tuple[int, int, int], told: TeamArrays, dgus: tuple[int, ...]) -> AlarmRecord:
    row, member, accused = change
    output = told.accusation(row, member, accused)
    return AlarmRecord(
        step=first_step + row,
        source=dgus[accused],
        monitor=dgus[member],
        active=bool(output.alarm),
        residual=tuple(map(float, output.residual)),
        threshold=tuple(map(float, output.threshold)),
    )


def _announced(team: RunTeam, block: Block) -> NDArray[np.float64]:
    """What the DGUs announce, shape (steps, announcing DGUs, 2)."""
    topics = team.topics
    positions = [topics.dgus.index(dgu) for dgu in topics.announcing]
    inputs = np.stack([block.load_current[:, 0, positions], block.reference[:, 0, positions]], axis=-1)
    inputs[..., [not told for told in team.plan.announced]] = np.nan
    return inputs
