"""The team's part of a run without ROS, and of a replay."""

from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from bags.mcap.errors import BagError
from bags.mcap.topic import Topic
from bags.mcap.writer import BagWriter
from bags.runs.run_record import RunRecord
from bags.watch.histories import grid_history_of_run
from bags.watch.team import RunTeam, run_team, team_design_record
from bags.watch.team_record import TeamArrays, TeamRecord, accusation_changes
from bags.wire.convert import history_of
from bags.wire.records import AlarmRecord, HistoryRecord
from bags.wire.schema import RunTopics
from dgu_sim.scenario import Scenario
from dgu_sim.simulate import Block


@final
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


def team_of_run(scenario: Scenario, topics: RunTopics) -> TeamProgress | None:
    """The team of a scenario, designed from its experiment on the whole grid; None without one.

    Raises:
        BagError: The recorded history cannot be read.
    """
    if topics.team is None:
        return None
    records = tuple(grid_history_of_run(scenario))
    return TeamProgress(team=run_team(scenario, topics.team, history_of(records)), histories=records)


def team_of_record(scenario: Scenario, record: RunRecord) -> TeamProgress | None:
    """The team of a scenario, designed from what a bag has recorded; None without one.

    Raises:
        BagError: The run had no team whose experiment could be used.
    """
    if scenario.monitor.team is None:
        return None
    if record.topics.team is None or record.team is None or not record.team.histories:
        raise BagError(f"{record.path}: holds no /grid/history, expected the record of a run with monitor.team")
    histories = record.team.histories
    return TeamProgress(team=run_team(scenario, record.topics.team, history_of(histories)), histories=histories)


def write_team_documents(writer: BagWriter, progress: TeamProgress) -> None:
    """Write what stands before step 0."""
    topics, design = progress.team.topics, progress.team.design
    history = topics.history()
    for record in progress.histories:
        writer.write(history.topic.name, 0, history.encode(record))
    for member in topics.dgus:
        codec = topics.design(member)
        writer.write(codec.topic.name, 0, codec.encode(team_design_record(design, member)))


def fill_team(
    rows: NDArray[np.void], progress: TeamProgress, block: Block, events: dict[int, list[tuple[Topic, bytes]]]
) -> None:
    """Step the team through a block, write what is told into its messages, and add its accusations to the events."""
    topics = progress.team.topics
    told, changes = progress.take(block.y[:, 0], block.received[:, 0], _announced(progress.team, block))
    numbers = {
        **{topics.inputs(dgu).topic.name: ("dgu", dgu) for dgu in topics.announcing},
        **{topics.estimate(member).topic.name: ("monitor", member) for member in topics.dgus},
    }
    for name, fields in told.targets(topics).items():
        field, number = numbers[name]
        rows[name][field] = number
        for key, values in fields.items():
            rows[name][key] = values
    for row, member, accused in changes:
        codec = topics.alarms(topics.dgus[member])
        output = told.accusation(row, member, accused)
        data = codec.encode(block.first_step + row, topics.dgus[accused], output)
        events.setdefault(row, []).append((codec.topic, data))


def replayed_team(progress: TeamProgress, window: RunRecord) -> tuple[TeamArrays, TeamRecord]:
    """Step the team through a window of a recorded run."""
    assert window.told is not None  # noqa: S101 - team_of_record made sure of it
    told, changes = progress.take(window.y, window.received, window.told.inputs)
    dgus = progress.team.topics.dgus
    record = TeamRecord(
        designs={member: team_design_record(progress.team.design, member) for member in dgus},
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
