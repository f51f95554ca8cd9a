"""Consecutive steps of a recorded run in memory: all of them, or a window."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import final

import numpy as np
from numpy.typing import NDArray

from bags.runs.origin import SCENARIO_ATTACHMENT
from bags.watch.combined_arrays import CombinedArrays
from bags.watch.team_record import TeamArrays, TeamRecord
from bags.wire.records import AlarmRecord, DesignRecord, HistoryRecord, SecondRecord, StreamRecord
from bags.wire.schema import RunTopics
from dgu_sim.grid import Link
from dgu_sim.relay import Action, RelayEvent
from monitor.measures import spans


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class RunRecord:
    """What a bag says about a run, or about a window of it; axes "dgus" and "links" are in the order of `topics`.

    Attributes:
        path: The bag.
        topics: DGUs, links and sampling period.
        steps: Complete steps in here: a last step of which messages are missing is left out.
        first_step: Step of the first row; 0 unless this is a later window of a run.
        x: True states, shape (steps, dgus, 3): V [V], I_t [A], v [V s].
        load_current: I_L, shape (steps, dgus) [A].
        reference: V_ref + alpha, shape (steps, dgus) [V].
        alpha: Secondary correction, shape (steps, dgus) [V].
        y: Outputs as sent, shape (steps, dgus, 3) [V, A, V s].
        received: Outputs as the receivers took them, shape (steps, links, 3) [V, A, V s].
        delivered: False where a link lost the sample, shape (steps, links).
        phase: Phase of each monitor (the constants of Residual.msg), shape (steps, links).
        alarm: Verdict of each monitor, shape (steps, links).
        estimate: State estimates, shape (steps, links, 3) [V, A, V s].
        residual: Residuals, shape (steps, links, 3) [V, A, V s]; NaN where there is none.
        threshold: Thresholds, shape (steps, links, 3) [V, A, V s]; NaN before they are set.
        histories: Offline experiments, by DGU and number.
        designs: What was designed for each link; for the own state of DGU j, as link j-j.
        events: Attacks that started or stopped anywhere in the run, in order of time.
        alarms: Alarms that started or ended at these steps, in order of time.
        attachments: Documents in the bag by name.
        told: What the members of the team told, None without a team.
        team: Designs and accusations of the team, None without.
        streams: Faults of the streams of messages that appeared or ended at these steps, in order of time.
        seconds: Messages of second publishers of these steps, in the order of the bag.
        combined: What monitors that draw one conclusion from several tests said besides; None: they do not.
        input_designs: What estimates the input of the source of each link; empty without plausibility tests.
    """

    path: Path
    topics: RunTopics
    steps: int
    x: NDArray[np.float64]
    load_current: NDArray[np.float64]
    reference: NDArray[np.float64]
    alpha: NDArray[np.float64]
    y: NDArray[np.float64]
    received: NDArray[np.float64]
    delivered: NDArray[np.bool_]
    phase: NDArray[np.uint8]
    alarm: NDArray[np.bool_]
    estimate: NDArray[np.float64]
    residual: NDArray[np.float64]
    threshold: NDArray[np.float64]
    histories: tuple[HistoryRecord, ...]
    designs: Mapping[Link, DesignRecord]
    events: tuple[RelayEvent, ...]
    alarms: tuple[AlarmRecord, ...]
    attachments: Mapping[str, bytes]
    first_step: int = 0
    told: TeamArrays | None = None
    team: TeamRecord | None = None
    streams: tuple[StreamRecord, ...] = ()
    seconds: tuple[SecondRecord, ...] = ()
    combined: CombinedArrays | None = None
    input_designs: Mapping[Link, DesignRecord] = field(default_factory=dict)

    @property
    def links(self) -> tuple[Link, ...]:
        """The links, ordered by (target, source)."""
        return self.topics.links

    @property
    def sampling_period_sec(self) -> float:
        """T_s [s]."""
        return self.topics.sampling_period_ns * 1e-9

    @property
    def time_sec(self) -> NDArray[np.float64]:
        """Simulated time of each step, shape (steps,) [s]."""
        return np.arange(self.first_step, self.end_step, dtype=np.float64) * self.sampling_period_sec

    @property
    def end_step(self) -> int:
        """The step behind the last row."""
        return self.first_step + self.steps

    @property
    def scenario_text(self) -> str:
        """The scenario as YAML, "" when the bag holds none."""
        return self.attachments.get(SCENARIO_ATTACHMENT, b"").decode()

    def attack_intervals(self, link: Link, end: int | None = None) -> tuple[tuple[int, int], ...]:
        """Steps [start, stop) of the attacks on a link, by start.

        Args:
            link: The link.
            end: Where an attack without a stop ends; None: behind the last row.
        """
        changes = ((one.step, one.attack, one.action is Action.START) for one in self.events if one.link == link)
        found = spans(changes, self.end_step if end is None else end)
        return tuple(sorted(one for intervals in found.values() for one in intervals))
