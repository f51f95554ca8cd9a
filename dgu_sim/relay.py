"""The attacker's place: a relay on every communication link, transparent until an attack is started."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from dgu_sim.attacks import AttackContext, Knowledge, build_attack
from dgu_sim.errors import AttackError
from dgu_sim.grid import Link
from dgu_sim.records import Sample
from dgu_sim.relay_records import Action, AttackPlan, Origin, RelayEvent, RelayState, RunningAttack, Spoofing
from dgu_sim.signals import first_step

__all__ = ["Action", "AttackPlan", "Origin", "Relay", "RelayEvent", "RelayState", "RunningAttack", "Spoofing"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Relay:
    """Passes every output on along every link; several attacks on one link act in the order of their numbers.

    Attributes:
        dgus: DGU numbers in the order of the outputs.
        links: The links in the order of the received samples.
        sampling_period_sec: T_s.
        seed: Seed of the run that it relays in floats, or of each run that it relays in arrays.
        insight: What attackers can find out about the grid; None: nothing.
        ready_sec: Time until which the detectors learn from samples that must be free of attacks [s].
        sources: Position in `dgus` of the sender of each link, derived.
    """

    dgus: tuple[int, ...]
    links: tuple[Link, ...]
    sampling_period_sec: float
    seed: int | tuple[int, ...] = 0
    insight: Knowledge | None = None
    ready_sec: float = 0.0
    sources: tuple[int, ...] = field(init=False)

    def __post_init__(self) -> None:
        """Derive `sources`."""
        object.__setattr__(self, "sources", tuple(self.dgus.index(link.source) for link in self.links))

    def init(self, plans: Sequence[AttackPlan] = ()) -> RelayState:
        """Return the state before step 0 with the attacks of a scenario scheduled.

        Raises:
            AttackError: A link does not exist or an attack's parameters are wrong.
        """
        state = RelayState(step=0, attacks=(), next_number=1)
        for plan in plans:
            start_step = first_step(plan.start_sec, self.sampling_period_sec)
            stop_step = None
            if plan.stop_sec is not None:  # an attack that falls between two samples still has one
                stop_step = max(start_step + 1, first_step(plan.stop_sec, self.sampling_period_sec))
            state, _ = self._schedule(state, plan, Origin.SCENARIO, start_step, stop_step)
        return state

    def start(
        self,
        state: RelayState,
        link: Link,
        kind: str,
        parameters: Mapping[str, object],
        duration_sec: float = 0.0,
        *,
        origin: Origin = Origin.SERVICE,
        start_sec: float | None = None,
    ) -> tuple[RelayState, RelayEvent]:
        """Start an attack from the next step on, or later.

        Args:
            state: Where the relay is.
            link: The link to act on.
            kind: Name of the attack class.
            parameters: Its parameters. For an attack on several links they may hold `links`: ["2-4", "3-4"], all of
                its links in their order, `link` the first; and `anyway`: true, to start while detectors learn.
            duration_sec: Length [s]; 0: until stopped.
            origin: Who asked for it.
            start_sec: Time of the first affected sample [s]; None: the next one.

        Returns:
            The new state and the START event of `link`; `step` reports those of the other links only, or, of an attack
            that starts later, all of them.

        Raises:
            AttackError: A link does not exist, the kind is unknown, a parameter is wrong, or a person wants to start it
                while the detectors learn.
        """
        if not (math.isfinite(duration_sec) and duration_sec >= 0.0):
            raise AttackError(f"duration_sec = {duration_sec:g}: expected a length in seconds, or 0 for until stopped")
        length = max(1, first_step(duration_sec, self.sampling_period_sec)) if duration_sec > 0.0 else None
        start_step = self._start_step(state, start_sec)
        stop_step = None if length is None else start_step + length
        start_sec = start_step * self.sampling_period_sec
        links, own = _split_links(link, parameters)
        early = own.pop("anyway", False) is not True and origin is Origin.SERVICE and start_sec < self.ready_sec
        plan = AttackPlan(links=links, kind=kind, parameters=own, start_sec=start_sec)
        following, attack = self._schedule(state, plan, origin, start_step, stop_step)
        if early:
            learn = f"until {self.ready_sec:g} s the detectors learn from attack-free samples"
            now = f"it would start at {start_sec:g} s, and {learn}"
            raise AttackError(f"link {link}: {now}: expected later, or `anyway`, which they take for normal")
        return following, attack.event(link, Action.START, start_step)

    def stop(self, state: RelayState, link: Link) -> tuple[RelayState, tuple[RelayEvent, ...]]:
        """Stop every active attack on one link from the next step on; scheduled ones stay scheduled.

        Returns:
            The new state and the STOP events; `step` does not report them again.

        Raises:
            AttackError: The link does not exist or no attack is active on it.
        """
        self._position(link)
        ended = [one for one in state.attacks if link in one.links and one.announced(state.step)]
        if not ended:
            raise AttackError(f"link {link}: no attack is active on it, expected one to stop")
        numbers = {one.number for one in ended}
        rest = tuple(one for one in state.attacks if one.number not in numbers)
        events = tuple(one.event(each, Action.STOP, state.step) for one in ended for each in one.announced(state.step))
        return replace(state, attacks=rest), events

    def step(
        self, state: RelayState, outputs: Sequence[Sample]
    ) -> tuple[RelayState, tuple[Sample, ...], tuple[RelayEvent, ...]]:
        """Relay one step.

        Args:
            state: Where the relay is.
            outputs: What the DGUs sent, in the order of `dgus`.

        Returns:
            The next state (with what second publishers sent), the samples that the links deliver in the order of
            `links`, and the events of attacks that the scenario starts, or that end by themselves, at this step.
        """
        samples = [outputs[source] for source in self.sources]
        if not state.attacks:
            return RelayState(step=state.step + 1, attacks=(), next_number=state.next_number), tuple(samples), ()
        attacks: list[RunningAttack] = []
        events: list[RelayEvent] = []
        spoofed: dict[int, Sample] = {}
        for one in state.attacks:
            if one.stop_step is not None and state.step >= one.stop_step:
                events += [one.event(link, Action.STOP, state.step) for link in one.links]
            elif state.step < one.start_step:
                attacks.append(one)
            else:
                told = len(one.announced(state.step))
                events += [one.event(link, Action.START, state.step) for link in one.links[told:]]
                attacks.append(self._apply(one, samples, spoofed))
        following = RelayState(
            step=state.step + 1,
            attacks=tuple(attacks),
            next_number=state.next_number,
            spoofed=tuple(sorted(spoofed.items(), key=lambda item: item[0])),
        )
        return following, tuple(samples), tuple(events)

    def untouched(self, state: RelayState) -> float:
        """Return for how many steps from now on every link passes on what it gets, and nothing is to be told."""
        return max(0.0, min((one.start_step - state.step for one in state.attacks), default=math.inf))

    def passed(self, state: RelayState, steps: int) -> RelayState:
        """Return the state after steps that `untouched` promised."""
        return replace(state, step=state.step + steps, spoofed=())

    def pending(self, state: RelayState) -> tuple[tuple[RelayEvent, float], ...]:
        """Return the START event and the stop time [s] (NaN: until stopped) of each active or scheduled attack."""
        return tuple(
            (
                one.event(link, Action.START, one.start_step),
                math.nan if one.stop_step is None else one.stop_step * self.sampling_period_sec,
            )
            for one in state.attacks
            for link in one.links
        )

    def spoofings(self, state: RelayState) -> tuple[Spoofing, ...]:
        """Return where, of what is active or scheduled, a second publisher speaks."""
        return tuple(
            Spoofing(link=link, first_step=one.start_step, end_step=one.stop_step)
            for one in state.attacks
            if one.attack.publishes
            for link in one.links
        )

    def _start_step(self, state: RelayState, start_sec: float | None) -> int:
        if start_sec is None:
            return state.step
        start_step = first_step(start_sec, self.sampling_period_sec) if math.isfinite(start_sec) else -1
        if start_step < state.step:
            now = state.step * self.sampling_period_sec
            raise AttackError(f"start_sec = {start_sec:g}: expected a time from now on, it is {now:g} s")
        return start_step

    def _apply(self, one: RunningAttack, samples: list[Sample], spoofed: dict[int, Sample]) -> RunningAttack:
        """Replace the samples of an attack's links in place and return it with its next state."""
        state, changed = one.attack.step(one.state, [samples[position] for position in one.positions])
        target: list[Sample] | dict[int, Sample] = spoofed if one.attack.publishes else samples
        for position, sample in zip(one.positions, changed, strict=True):
            target[position] = sample
        return one if state is one.state else replace(one, state=state)

    def _schedule(
        self, state: RelayState, plan: AttackPlan, origin: Origin, start_step: int, stop_step: int | None
    ) -> tuple[RelayState, RunningAttack]:
        positions = tuple(self._position(link) for link in plan.links)
        attack = build_attack(plan.kind, plan.parameters)
        attack.check_links(plan.links)
        if attack.whole_output:
            self._check_sent(plan)
        if attack.publishes:
            self._check_alone(state, plan, start_step, stop_step)
        context = AttackContext(
            links=plan.links,
            sampling_period_sec=self.sampling_period_sec,
            number=state.next_number,
            seed=self.seed,
            insight=self.insight,
        )
        running = RunningAttack(
            number=state.next_number,
            links=plan.links,
            positions=positions,
            kind=plan.kind,
            parameters=json.dumps(attack.model_dump(mode="json"), sort_keys=True),
            origin=origin,
            attack=attack,
            state=attack.init(context),
            start_step=start_step,
            stop_step=stop_step,
            asked_step=state.step,
        )
        return replace(state, attacks=(*state.attacks, running), next_number=state.next_number + 1), running

    def _check_sent(self, plan: AttackPlan) -> None:
        """Check that the sources of the links send their whole output, as far as anything is known of them."""
        for link in plan.links:
            if self.insight is not None and (hidden := self.insight.keeps(link.source)):
                found = f"DGU {link.source} keeps {', '.join(hidden)}"
                raise AttackError(f"link {link}: {found}, and {plan.kind} starts from whole samples of V, I_t and v")

    def _check_alone(self, state: RelayState, plan: AttackPlan, start_step: int, stop_step: int | None) -> None:
        """Check that no link gets a third publisher, and that a true message comes first: it is what is imitated."""
        if start_step == 0:
            raise AttackError(f"{plan.kind} from step 0: expected step 1 or later, a second publisher needs a first")
        for other in self.spoofings(state):
            ends = (math.inf if end is None else end for end in (other.end_step, stop_step))
            if other.link in plan.links and max(other.first_step, start_step) < min(ends):
                raise AttackError(f"link {other.link}: a second publisher speaks there already, expected one at a time")

    def _position(self, link: Link) -> int:
        if link not in self.links:
            known = ", ".join(str(one) for one in self.links) or "none: the scenario has no lines"
            raise AttackError(f"link {link}: expected a communication link of this run: {known}")
        return self.links.index(link)


def _split_links(link: Link, parameters: Mapping[str, object]) -> tuple[tuple[Link, ...], dict[str, object]]:
    """Return the links that a request means, and the parameters of the attack class."""
    if not isinstance(parameters, Mapping):
        raise AttackError(f"parameters = {parameters!r}: expected a mapping of keys to values")
    names = parameters.get("links", [str(link)])
    if not (isinstance(names, list | tuple) and names and all(isinstance(name, str) for name in names)):
        raise AttackError(f"links = {names!r}: expected a list of links, like ['2-4', '3-4']")
    links = tuple(Link.parse(str(name)) for name in names)
    if links[0] != link or len(set(links)) < len(links):
        raise AttackError(f"links = {names!r}: expected different links, {link} the first")
    return links, {key: value for key, value in parameters.items() if key != "links"}
