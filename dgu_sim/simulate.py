"""The only time loop: all DGUs, all links and any number of runs at once."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from dgu_sim.attacker_knowledge import ScenarioKnowledge
from dgu_sim.block import Block, Doubled, Rows, RunEvent
from dgu_sim.cell import Cell, UnitState
from dgu_sim.commands import AttackCommand, Command
from dgu_sim.compiled import CompiledCell, compiled_cell
from dgu_sim.errors import DguSimError
from dgu_sim.linear import FloatArray
from dgu_sim.obeying import obey
from dgu_sim.relay import Relay, RelayEvent, RelayState
from dgu_sim.scenario import Scenario
from dgu_sim.script import CommandEvent, Commands, Teller
from dgu_sim.unit import cell_of_all
from dgu_sim.wiring import Wiring

__all__ = ["Block", "Doubled", "Loop", "LoopState", "Respond", "RunEvent", "loop_of", "relay_of", "simulate"]

BLOCK_STEPS = 1000


class Respond(Protocol):
    """What the DGUs' monitors make of one step of all runs; called once a step, in order."""

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
        """Return the links that secondary control leaves out at this step, shape (runs, links).

        Args:
            sent: y as measured and sent, shape (3, runs, DGUs).
            reference: V_ref + alpha, shape (runs, DGUs) [V].
            received: y^c as taken, shape (3, runs, links).
            delivered: Shape (runs, links).
            spoofed: Positions of the links on which a second publisher spoke.
            commands: What was commanded from this step on.
        """
        ...


def relay_of(
    scenario: Scenario,
    seeds: tuple[int, ...] | None = None,
    recorded: Mapping[int, Sequence[FloatArray]] | None = None,
    ready_sec: float = 0.0,
) -> tuple[Relay, RelayState]:
    """Return the relay of a scenario's links and its state before step 0, attacks scheduled.

    Args:
        scenario: The scenario.
        seeds: Seeds of the runs whose samples are arrays; None: samples are floats, the seed is the scenario's.
        recorded: States (T, 3) of each recorded experiment by DGU, for attackers who know a history that is in a bag.
        ready_sec: Time until which monitors learn from samples that attacks by hand must not touch [s].

    Raises:
        AttackError: An attack cannot act on its links.
    """
    relay = Relay(
        dgus=scenario.grid.dgus,
        links=scenario.links,
        sampling_period_sec=scenario.sampling_period_sec,
        seed=scenario.seed if seeds is None else seeds,
        insight=ScenarioKnowledge(scenario=scenario, recorded=recorded),
        ready_sec=ready_sec,
    )
    return relay, relay.init([attack.plan for attack in scenario.attacks])


def simulate(
    scenario: Scenario,
    seeds: Sequence[int] | None = None,
    block_steps: int = BLOCK_STEPS,
    recorded: Mapping[int, Sequence[FloatArray]] | None = None,
    respond: Respond | None = None,
    *,
    commands: Commands | None = None,
) -> Iterator[Block]:
    """Run a scenario from step 0 to its end.

    Args:
        scenario: What to run.
        seeds: One run for each seed; None: one run with the scenario's own.
        block_steps: Steps in a block; the last one may be shorter.
        recorded: As for `relay_of`.
        respond: What the monitors tell secondary control; None: nothing.
        commands: Asked at the top of every step for what acts from it on; None: the scenario's script.

    Yields:
        Blocks in order of time. How runs and steps are grouped changes no bit of them.

    Raises:
        DguSimError: What `commands.refused` raises.
    """
    loop, state = loop_of(scenario, seeds, recorded, commands=commands)
    for first in range(0, scenario.steps, block_steps):
        state, block = loop.run(state, min(block_steps, scenario.steps - first), respond)
        yield block


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopState:
    """Where all runs are before a step; nothing in it changes, so a run can go on from it more than once.

    Attributes:
        step: The next step.
        cell: State of all DGUs.
        relay: State of the links: who attacks them.
        teller: How many commands were told.
    """

    step: int
    cell: UnitState
    relay: RelayState
    teller: Teller = field(default_factory=Teller)


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop:
    """The time loop of a scenario, which goes on as long as it is called.

    Attributes:
        runs: Number of runs.
        cell: All DGUs.
        relay: All links.
    """

    runs: int
    cell: Cell
    relay: Relay
    _wiring: Wiring
    _compiled: CompiledCell | None
    _given: Commands | None

    def run(self, state: LoopState, steps: int, respond: Respond | None = None) -> tuple[LoopState, Block]:
        """Let all runs go on; how their steps are grouped changes no bit of them.

        Args:
            state: Where they are.
            steps: How many steps.
            respond: What the monitors tell secondary control; None: nothing.
        """
        if self._compiled is not None and self._given is None:
            return self._run_compiled(self._compiled, state, steps, respond)
        wiring = self._wiring
        buffer = Rows.empty(steps, self.runs, wiring.dgus, len(wiring.sources))
        cell_state, relay_state = state.cell, state.relay
        events: list[RelayEvent] = []
        doubled: list[Doubled] = []
        told: list[CommandEvent] = []
        teller = state.teller
        for row in range(steps):
            truth, sent = buffer.truth[row], buffer.sent[row]
            received, delivered = buffer.received[row], buffer.delivered[row]
            new: list[CommandEvent] = []
            for command in () if self._given is None else self._given.due(state.step + row):
                cell_state, relay_state, occurred = self._obey(command, cell_state, relay_state)
                if occurred is not None:
                    teller, event = teller.event(state.step + row, command)
                    new.append(event)
                    events += occurred
            told += new
            output = self.cell.output(cell_state)
            truth[:3], truth[3], truth[4], truth[5] = output.x, output.load_current, output.reference, output.alpha
            sent[:] = output.y
            relay_state, occurred = wiring.relay(self.relay, relay_state, sent, received, delivered)
            events += occurred
            spoofed: tuple[int, ...] = ()
            if relay_state.spoofed:
                doubled += wiring.spoof(state.step + row, relay_state, received, delivered)
                spoofed = tuple(position for position, _ in relay_state.spoofed)
            heard = delivered
            if respond is not None:
                heard = delivered & ~respond(sent, truth[4], received, delivered, spoofed, commands=new)
            cell_state = self.cell.step(cell_state, wiring.physical(truth), wiring.received(received, heard))
        attacks = tuple(RunEvent(run=run, event=one) for one in events for run in range(self.runs))
        following = LoopState(step=state.step + steps, cell=cell_state, relay=relay_state, teller=teller)
        return following, buffer.block(state.step, attacks, tuple(doubled), tuple(told))

    def _obey(
        self, command: Command, cell: UnitState, relay: RelayState
    ) -> tuple[UnitState, RelayState, tuple[RelayEvent, ...] | None]:
        """Let a command act on the DGUs or on the relay; attack events that are told at once, None: it is refused."""
        if not isinstance(command, AttackCommand):
            return self.cell.steer(cell, command), relay, ()
        try:
            relay, occurred, _ = obey(self.relay, relay, command)
        except DguSimError as error:
            assert self._given is not None  # noqa: S101 - somebody gave it
            self._given.refused(command, error)
            return cell, relay, None
        return cell, relay, occurred

    def _run_compiled(
        self, compiled: CompiledCell, state: LoopState, steps: int, respond: Respond | None
    ) -> tuple[LoopState, Block]:
        """Do as `run`, in kernels wherever nobody touches a link."""
        wiring, rows, relay_state = self._wiring, compiled.rows(state.cell, steps), state.relay
        events: list[RelayEvent] = []
        doubled: list[Doubled] = []
        row = 0
        while row < steps:
            quiet = 0 if respond is not None else int(min(self.relay.untouched(relay_state), steps - row))
            if quiet > 0:
                taken = rows.advance(row, quiet)
                relay_state, row = self.relay.passed(relay_state, taken), row + taken
                continue
            rows.say(row)
            sent, received = np.moveaxis(rows.y[row], -1, 0), np.moveaxis(rows.received[row], -1, 0)
            delivered = heard = rows.delivered[row]
            relay_state, occurred = wiring.relay(self.relay, relay_state, sent, received, delivered)
            events += occurred
            if relay_state.spoofed:
                doubled += wiring.spoof(state.step + row, relay_state, received, delivered)
            if respond is not None:
                spoofed = [position for position, _ in relay_state.spoofed]
                heard = delivered & ~respond(sent, rows.reference[row], received, delivered, spoofed)
            rows.move(row, heard)
            row += 1
        told = tuple(RunEvent(run=run, event=one) for one in events for run in range(self.runs))
        following = LoopState(step=state.step + steps, cell=rows.state, relay=relay_state)
        return following, Block(
            first_step=state.step,
            x=rows.x,
            y=rows.y,
            load_current=rows.load_current,
            reference=rows.reference,
            alpha=rows.alpha,
            received=rows.received,
            delivered=rows.delivered,
            events=told,
            doubled=tuple(doubled),
        )


def loop_of(
    scenario: Scenario,
    seeds: Sequence[int] | None = None,
    recorded: Mapping[int, Sequence[FloatArray]] | None = None,
    ready_sec: float = 0.0,
    commands: Commands | None = None,
) -> tuple[Loop, LoopState]:
    """Return the time loop of a scenario and its state before step 0.

    Args:
        scenario: What to run.
        seeds: One run for each seed; None: one run with the scenario's own.
        recorded: As for `relay_of`.
        ready_sec: As for `relay_of`.
        commands: Asked at the top of every step for what acts from it on; None: the scenario's script.

    Raises:
        AttackError: An attack cannot act on its links.
    """
    runs = (scenario.seed,) if seeds is None else tuple(seeds)
    given = scenario.orders if commands is None and scenario.script else commands
    cell = cell_of_all(scenario, runs)
    relay, relay_state = relay_of(scenario, runs, recorded, ready_sec)
    wiring = Wiring.of(scenario)
    compiled = compiled_cell(
        cell,
        len(runs),
        sources=wiring.sources,
        physical=wiring.physical_slots,
        incoming=wiring.link_slots,
        wired=wiring.wired[0],
    )
    loop = Loop(runs=len(runs), cell=cell, relay=relay, _wiring=wiring, _compiled=compiled, _given=given)
    return loop, LoopState(step=0, cell=cell.init(), relay=relay_state)
