"""A DGU node's part in a team of monitors: the experiment on the whole grid, and what acts on the DGU."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bags.wire.convert import announced

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bags.wire.records import HistoryRecord
    from bags.wire.schema import RunTopics
    from dcmg_nodes.ports import Ports
    from dgu_sim.unit import UnitOutput
    from monitor.team import TeamPlan


class Announcer:
    """Tells members of the team that do not hear a DGU what acts on it."""

    def __init__(self, ports: Ports, topics: RunTopics, dgu: int, plan: TeamPlan) -> None:
        """Tell nothing yet."""
        self._ports, self._topics, self._plan = ports, topics, plan
        self._codec = topics.announced(dgu) if dgu in topics.announcing else None

    def publish_history(self, records: Sequence[HistoryRecord]) -> None:
        """Publish the experiment on the whole grid, if this DGU is the one that does."""
        codec = self._topics.grid_history()
        for record in records:
            self._ports.publish(codec.topic.name, codec.encode(record))

    def announce(self, step: int, output: UnitOutput) -> None:
        """Tell the inputs of one step."""
        if self._codec is not None:
            inputs = announced((float(output.load_current), float(output.reference)), self._plan.announced)
            self._ports.publish(self._codec.topic.name, self._codec.encode(step, inputs))
