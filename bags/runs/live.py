"""A run without ROS that goes on as long as it is asked to, that somebody attacks by hand, and that can be forked."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from bags.runs.following import Followed, watched
from bags.watch.designs import RunDesigns
from bags.watch.histories import recorded_states
from bags.watch.watcher import Watcher
from dgu_sim.grid import Link
from dgu_sim.linear import FloatArray
from dgu_sim.relay import RelayEvent
from dgu_sim.scenario import Scenario
from dgu_sim.script import CommandEvent
from dgu_sim.simulate import Loop, LoopState, Respond, RunEvent, loop_of


@dataclass(slots=True, kw_only=True)
class LiveRun:
    """One run of a scenario under the eyes of its monitors; a command acts from the next step on.

    Left alone, its steps are those of `simulate_to_bag`, bit for bit, however they are grouped.

    Attributes:
        scenario: What runs.
        designs: What its monitors run.
        state: Where it is.
        cut: Positions of the links that secondary control leaves out, whatever the monitors say.
    """

    scenario: Scenario
    designs: RunDesigns
    state: LoopState
    _loop: Loop
    _watch: Watcher
    _told: list[RelayEvent] = field(default_factory=list)
    cut: set[int] = field(default_factory=set)

    @classmethod
    def of(cls, scenario: Scenario, designs: RunDesigns) -> "LiveRun":
        """The run before step 0.

        Raises:
            AttackError: An attack of the scenario cannot act on its links.
            monitor.errors.MonitorError: Unknown observer or detector, or options of theirs.
        """
        ready_sec = designs.settings.calibrated_sec
        loop, state = loop_of(scenario, None, recorded_states(scenario), ready_sec)
        return cls(scenario=scenario, designs=designs, state=state, _loop=loop, _watch=Watcher(designs=designs))

    def advance(self, steps: int) -> Followed:
        """Make so many steps, at least one."""
        respond: Respond | None = self._watch if self.designs.settings.response is not None else None
        told = respond if not self.cut else _Leaving(respond, tuple(sorted(self.cut)))
        self.state, block = self._loop.run(self.state, steps, told)
        if self._told:
            begun = tuple(RunEvent(run=0, event=one) for one in self._told)
            block, self._told = replace(block, events=(*begun, *block.events)), []
        return watched(self._watch, block) if respond is None else Followed(block, *self._watch.take())

    def check(self, link: Link, kind: str, parameters: Mapping[str, object], duration_sec: float = 0.0) -> None:
        """See whether `start` would; raises what it does, and changes nothing."""
        self._loop.relay.start(self.state.relay, link, kind, parameters, duration_sec)

    def start(self, link: Link, kind: str, parameters: Mapping[str, object], duration_sec: float = 0.0) -> RelayEvent:
        """Start an attack; see `dgu_sim.relay.Relay.start`.

        Raises:
            AttackError: It cannot be: one line. Then nothing is changed.
        """
        relay, event = self._loop.relay.start(self.state.relay, link, kind, parameters, duration_sec)
        self._take(replace(self.state, relay=relay), (event,))
        return event

    def stop(self, link: Link) -> tuple[RelayEvent, ...]:
        """Stop all attacks that are active on a link.

        Raises:
            AttackError: There is none.
        """
        relay, events = self._loop.relay.stop(self.state.relay, link)
        self._take(replace(self.state, relay=relay), events)
        return events

    def change(self, link: Link, kind: str, parameters: Mapping[str, object], duration_sec: float = 0.0) -> RelayEvent:
        """Put another attack in the place of all that are active on a link, without a clean sample between them.

        Raises:
            AttackError: None is active, or the new one cannot be. Then nothing is changed.
        """
        relay, ended = self._loop.relay.stop(self.state.relay, link)
        relay, event = self._loop.relay.start(relay, link, kind, parameters, duration_sec)
        self._take(replace(self.state, relay=relay), (*ended, event))
        return event

    def fork(self) -> "LiveRun":
        """The same run from here on, with a future of its own."""
        return replace(self, _watch=self._watch.fork(), _told=list(self._told), cut=set(self.cut))

    def _take(self, state: LoopState, events: tuple[RelayEvent, ...]) -> None:
        self.state = state
        self._told += events


@dataclass(frozen=True, slots=True)
class _Leaving:
    """A response, if there is one, and links that are left out besides."""

    inner: Respond | None
    cut: tuple[int, ...]

    def __call__(
        self,
        sent: FloatArray,
        reference: FloatArray,
        received: FloatArray,
        delivered: NDArray[np.bool_],
        spoofed: Sequence[int] = (),
        *,
        commands: Sequence[CommandEvent] = (),
    ) -> NDArray[np.bool_]:
        dropped = np.zeros(delivered.shape, dtype=np.bool_)
        if self.inner is not None:
            dropped |= self.inner(sent, reference, received, delivered, spoofed, commands=commands)
        dropped[:, self.cut] = True
        return dropped
