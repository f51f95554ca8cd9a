"""The alarms that start or end, from the verdicts at every step."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bags.watch.combined_arrays import CombinedFields
from bags.watch.monitors import MonitorArrays, alarm_changes
from bags.wire.records import AlarmRecord
from bags.wire.schema import RunTopics
from dgu_sim.grid import Link


def link_alarms(
    outputs: MonitorArrays, before: NDArray[np.bool_], first_step: int, links: Sequence[Link]
) -> list[AlarmRecord]:
    """The alarms on links, in the order in which they are told.

    Args:
        outputs: What the monitors concluded over some steps.
        before: Verdicts at the step before the first, shape (links,).
        first_step: Step of the first row.
        links: The links.
    """
    return [
        AlarmRecord(
            step=first_step + row,
            source=links[position].source,
            monitor=links[position].target,
            active=bool(outputs.alarm[row, position]),
            residual=tuple(outputs.residual[row, position].tolist()),
            threshold=tuple(outputs.threshold[row, position].tolist()),
        )
        for row, position in alarm_changes(outputs.alarm, before, links)
    ]


def local_alarms(
    fields: CombinedFields, before: NDArray[np.bool_], first_step: int, topics: RunTopics
) -> list[AlarmRecord]:
    """The alarms of the own states, in order of time; `before` (monitors,) are the verdicts at the step before."""
    if not fields.local:
        return []
    own = [Link(monitor, monitor) for monitor in topics.monitors]
    return link_alarms(MonitorArrays(**fields.local), before, first_step, own)


def in_order(alarms: Sequence[AlarmRecord]) -> list[AlarmRecord]:
    """Alarms in the order of their messages: a monitor tells of its links, then of its own state."""
    return sorted(alarms, key=lambda one: (one.step, one.monitor, one.source == one.monitor, one.source))
