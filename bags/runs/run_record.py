"""Consecutive steps of a recorded run in memory: all of them, or a window."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bags.watch.combined_arrays import CombinedArrays, CombinedFields
from bags.watch.team_record import TeamArrays, TeamRecord
from bags.wire.arrays import Arrays, group
from bags.wire.origin import SCENARIO_ATTACHMENT, VERSIONS_ATTACHMENT
from bags.wire.records import AlarmRecord, DesignRecord, HistoryRecord, SecondRecord, StreamRecord
from bags.wire.schema import RunTopics
from dgu_sim.commands import Command
from dgu_sim.grid import Link
from dgu_sim.relay import Action, RelayEvent
from dgu_sim.script import CommandEvent
from monitor.measures import spans


@dataclass(frozen=True, kw_only=True)
class RunRecord:
    """What a bag says about a run, or about a window of it; axes "dgus" and "links" are in the order of `topics`.

    Attributes:
        path: The bag.
        topics: DGUs, links and sampling period.
        steps: Complete steps in here: a last step of which messages are missing is left out.
        arrays: What was told at every step, by row and field of the table of messages: "residual.alarm"; see
            `bags.wire.arrays`. The most wanted ones are properties here.
        histories: Offline experiments, by DGU and number.
        designs: What was designed for each link; for the own state of DGU j, as link j-j.
        events: Attacks that started or stopped anywhere in the run, in order of time.
        alarms: Alarms that started or ended at these steps, in order of time.
        attachments: Documents in the bag by name.
        first_step: Step of the first row; 0 unless this is a later window of a run.
        team: Designs and accusations of the team, None without.
        streams: Faults of the streams of messages that appeared or ended at these steps, in order of time.
        seconds: Messages of second publishers of these steps, in the order of the bag.
        input_designs: What estimates the input of the source of each link; empty without plausibility tests.
        commands: What was commanded anywhere in the run, by step.
    """

    path: Path
    topics: RunTopics
    steps: int
    arrays: Arrays
    histories: tuple[HistoryRecord, ...]
    designs: Mapping[Link, DesignRecord]
    events: tuple[RelayEvent, ...]
    alarms: tuple[AlarmRecord, ...]
    attachments: Mapping[str, bytes]
    first_step: int = 0
    team: TeamRecord | None = None
    streams: tuple[StreamRecord, ...] = ()
    seconds: tuple[SecondRecord, ...] = ()
    input_designs: Mapping[Link, DesignRecord] = field(default_factory=dict)
    commands: tuple[CommandEvent, ...] = ()

    @property
    def x(self) -> NDArray[np.float64]:
        """True states, shape (steps, dgus, n); of a DGU: V [V], I_t [A], v [V s]."""
        return self.arrays["state.x"]

    @property
    def load_current(self) -> NDArray[np.float64]:
        """I_L, shape (steps, dgus) [A]."""
        return self.arrays["state.load_current"]

    @property
    def reference(self) -> NDArray[np.float64]:
        """V_ref + alpha, shape (steps, dgus) [V]."""
        return self.arrays["state.reference"]

    @property
    def alpha(self) -> NDArray[np.float64]:
        """Secondary correction, shape (steps, dgus) [V]."""
        return self.arrays["state.alpha"]

    @property
    def y(self) -> NDArray[np.float64]:
        """Outputs as sent, shape (steps, dgus, p) [V, A, V s]."""
        return self.arrays["output.y"]

    @property
    def received(self) -> NDArray[np.float64]:
        """Outputs as the receivers took them, shape (steps, links, p) [V, A, V s]."""
        return self.arrays["received.y"]

    @property
    def u(self) -> NDArray[np.float64]:
        """Known inputs that travelled with them, shape (steps, links, m)."""
        return self.arrays.get("received.u", np.empty((*self.delivered.shape, 0)))

    @property
    def delivered(self) -> NDArray[np.bool_]:
        """False where a link lost the sample, shape (steps, links)."""
        return self.arrays["received.delivered"]

    @property
    def phase(self) -> NDArray[np.uint8]:
        """Phase of each monitor (the constants of Residual.msg), shape (steps, links)."""
        return self.arrays["residual.phase"]

    @property
    def alarm(self) -> NDArray[np.bool_]:
        """Verdict of each monitor, shape (steps, links)."""
        return self.arrays["residual.alarm"]

    @property
    def estimate(self) -> NDArray[np.float64]:
        """State estimates, shape (steps, links, n) [V, A, V s]."""
        return self.arrays["residual.estimate"]

    @property
    def residual(self) -> NDArray[np.float64]:
        """Residuals, shape (steps, links, p) [V, A, V s]; NaN where there is none."""
        return self.arrays["residual.residual"]

    @property
    def threshold(self) -> NDArray[np.float64]:
        """Thresholds, shape (steps, links, p) [V, A, V s]; NaN before they are set."""
        return self.arrays["residual.threshold"]

    @cached_property
    def combined(self) -> CombinedArrays | None:
        """What monitors that draw one conclusion from several tests said besides; None: they do not."""
        if self.topics.combined is None:
            return None
        parts = (group(self.arrays, key) for key in ("verdict", "own_residual", "input"))
        verdict, local, inputs = parts
        return CombinedFields(verdict=verdict, local=local, inputs=inputs).arrays(self.topics)

    @cached_property
    def told(self) -> TeamArrays | None:
        """What the members of the team told, None without a team."""
        if self.topics.team is None:
            return None
        announced: list[NDArray[Any]] = list(group(self.arrays, "announced").values())
        unknown = np.full((self.steps, len(self.topics.announcing), 2), np.nan)  # the bag left the topics out
        inputs = np.stack(announced, axis=-1) if announced else unknown
        return TeamArrays(inputs=inputs, **group(self.arrays, "estimate"))

    def with_arrays(self, arrays: Arrays) -> "RunRecord":
        """The same with other arrays in the place of these."""
        return replace(self, arrays={**self.arrays, **arrays})

    def rows(self, start: int, stop: int) -> "RunRecord":
        """Rows [start, stop); events and alarms stay."""
        cut = {name: array[start:stop] for name, array in self.arrays.items()}
        return replace(self, arrays=cut, steps=stop - start, first_step=self.first_step + start)

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

    @property
    def versions(self) -> bytes:
        """What computed it, versions.json; empty when the bag does not say."""
        return self.attachments.get(VERSIONS_ATTACHMENT, b"")

    @property
    def given(self) -> dict[int, list[Command]]:
        """What was commanded from these steps on, by row."""
        found: dict[int, list[Command]] = {}
        for one in self.commands:
            if self.first_step <= one.step < self.end_step:
                found.setdefault(one.step - self.first_step, []).append(one.command)
        return found

    def attack_intervals(self, link: Link, end: int | None = None) -> tuple[tuple[int, int], ...]:
        """Steps [start, stop) of the attacks on a link, by start.

        Args:
            link: The link.
            end: Where an attack without a stop ends; None: behind the last row.
        """
        changes = ((one.step, one.attack, one.action is Action.START) for one in self.events if one.link == link)
        found = spans(changes, self.end_step if end is None else end)
        return tuple(sorted(one for intervals in found.values() for one in intervals))
