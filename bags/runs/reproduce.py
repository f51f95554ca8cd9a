"""A bag out of itself: its scenario and what was done by hand run again, and every message compared."""

from __future__ import annotations

import json
from dataclasses import dataclass
from hashlib import sha256
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bags.mcap.errors import BagError
from bags.runs.offline import simulate_to_bag
from bags.runs.reader import Run, open_run
from bags.sources.recorded import open_recorded
from bags.watch.carried import read_carried
from bags.watch.designs import design_scenario
from bags.wire import table
from bags.wire.origin import SCENARIO_ATTACHMENT, VERSIONS_ATTACHMENT
from bags.wire.plugins import check_plug_ins
from dgu_sim.commands import AttackCommand
from dgu_sim.relay import Action, Origin
from dgu_sim.scenario import Scenario, parse_scenario

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from dgu_sim.relay import RelayEvent

__all__ = ["Reproduction", "reproduce", "steered"]

_ANYWAY = "anyway"


@dataclass(frozen=True, slots=True, kw_only=True)
class Reproduction:
    """How a bag compares with its scenario run again.

    Attributes:
        path: The bag.
        topics: How many topics were compared.
        messages: How many messages.
        differing: Of each topic that differs: the first message that does, from 1; messages recorded, and made again.
        left_out: Topics that were not compared, and why.
        plug_ins: A line for each plug-in that is here in another version.
    """

    path: Path
    topics: int
    messages: int
    differing: Mapping[str, tuple[int, int, int]]
    left_out: Mapping[str, str]
    plug_ins: tuple[str, ...] = ()

    def document(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "bag": str(self.path),
            "identical": not self.differing,
            "topics": self.topics,
            "messages": self.messages,
            "differing": {
                topic: {"first": first, "recorded": recorded, "again": again}
                for topic, (first, recorded, again) in self.differing.items()
            },
            "left_out": dict(self.left_out),
            "plug_ins": list(self.plug_ins),
        }


def _untold(run: Run) -> bool:
    """Whether somebody started or stopped an attack while the run went on, and no command in the bag tells of it."""
    told = any(isinstance(one.command, AttackCommand) for one in run.commands)
    return not told and any(event.origin is Origin.SERVICE for event in run.events)


def steered(path: Path | str) -> Scenario:
    """The scenario of a run as it went: all commands are its script, and it ends where it ended.

    Raises:
        BagError: The bag is none of a run, or what was done cannot be told in a scenario: one line.
        ScenarioError: Its scenario cannot be used.
    """
    run = open_run(path)
    _check_plug_ins(run)
    return _steered(run)


def reproduce(path: Path | str, out: Path | str, progress: Callable[[int], None] | None = None) -> Reproduction:
    """Run a bag's scenario again, with the bag's own designs, without ROS, and compare every message.

    Args:
        path: The bag of a run.
        out: Where to write the bag that is made again; must not exist.
        progress: Called with the number of steps done.

    Raises:
        BagError: The bag is none of a run, or what was done cannot be told in a scenario: one line.
        ScenarioError: Its scenario cannot be used.
    """
    path, out = Path(path), Path(out)
    run = open_run(path)
    other_plug_ins = _check_plug_ins(run)
    scenario = _steered(run)
    designs = design_scenario(scenario, carried=read_carried(path))
    simulate_to_bag(scenario, out, progress, designs=designs)
    end_ns = run.steps * run.topics.sampling_period_ns  # what is there of a step that broke off does not count
    recorded, again = _digests(path, end_ns), _digests(out, end_ns)
    left_out = {}
    if _untold(run):
        left_out[table.ATTACKS.name] = "it tells who asked for an attack"
    for topic in recorded.keys() - again.keys():
        left_out.setdefault(topic, "no simulation makes it")
    compared = sorted(recorded.keys() - left_out.keys())
    differing = {}
    for topic in compared:
        if recorded[topic] != again[topic]:
            differing[topic] = (_first_difference(path, out, topic, end_ns), recorded[topic][0], again[topic][0])
    return Reproduction(
        path=path,
        topics=len(compared),
        messages=sum(recorded[topic][0] for topic in compared),
        differing=differing,
        left_out=left_out,
        plug_ins=other_plug_ins,
    )


def _check_plug_ins(run: Run) -> tuple[str, ...]:
    scenario, versions = (run.attachments.get(name, b"") for name in (SCENARIO_ATTACHMENT, VERSIONS_ATTACHMENT))
    return check_plug_ins(run.path, scenario.decode(), versions, [event.kind for event in run.events])


def _steered(run: Run) -> Scenario:
    text = run.attachments.get(SCENARIO_ATTACHMENT)
    if text is None:
        raise BagError(f"{run.path}: holds no {SCENARIO_ATTACHMENT}, expected the bag of a run")
    source = f"{run.path}/{SCENARIO_ATTACHMENT}"
    given = parse_scenario(text.decode(), source)
    period_sec = given.sampling_period_sec
    script = [{"step": one.step, **one.command.document()} for one in run.commands]
    length = f"duration_sec={run.steps * period_sec!r}"
    if not _untold(run):
        return parse_scenario(text.decode(), source, (f"script={json.dumps(script)}", length))
    attacks = [attack.model_dump(mode="json") for attack in given.attacks]
    for number, events in groupby(sorted(run.events, key=lambda one: one.attack), key=lambda one: one.attack):
        told = list(events)
        if number > len(attacks):
            attacks.append(_started(told, period_sec))
        _stop(run, attacks[number - 1], told, period_sec)
    changes = (f"attacks={json.dumps(attacks)}", f"script={json.dumps(script)}", length)
    return parse_scenario(text.decode(), source, changes)


def _started(events: list[RelayEvent], period_sec: float) -> dict[str, Any]:
    first = min((one for one in events if one.action is Action.START), key=lambda one: one.step)
    links = [str(one.link) for one in events if one.action is Action.START and one.step == first.step]
    where = {"link": links[0]} if len(links) == 1 else {"links": links}
    parameters = {key: value for key, value in json.loads(first.parameters).items() if key not in {_ANYWAY, "links"}}
    return {"kind": first.kind, **where, "start_sec": first.step * period_sec, **parameters}


def _stop(run: Run, attack: dict[str, Any], events: list[RelayEvent], period_sec: float) -> None:
    stops = [one for one in events if one.action is Action.STOP]
    if not stops or all(one.origin is not Origin.SERVICE for one in events):
        return
    steps = {one.step for one in stops}
    links = {str(one.link) for one in stops}
    if len(steps) > 1 or len(links) < len({str(one.link) for one in events}):
        raise BagError(f"{run.path}: attack {events[0].attack} was stopped link by link, which no scenario tells")
    attack["stop_sec"] = steps.pop() * period_sec


def _digests(path: Path, end_ns: int) -> dict[str, tuple[int, bytes]]:
    """Of each topic: how many messages, none too, and a digest of all of them in their order."""
    with open_recorded(path) as recorded:
        found: dict[str, tuple[int, Any]] = {topic: (0, sha256()) for topic in recorded.topics}
        for message in recorded.messages(recorded.channels):
            if message.time_ns >= end_ns:
                continue
            count, digest = found[message.channel.topic]
            digest.update(len(message.data).to_bytes(8, "little") + message.data)
            found[message.channel.topic] = (count + 1, digest)
    return {topic: (count, digest.digest()) for topic, (count, digest) in found.items()}


def _first_difference(one: Path, other: Path, topic: str, end_ns: int) -> int:
    """Number of the first message that differs, from 1."""
    number = 0
    for number, (first, second) in enumerate(
        zip(_payloads(one, topic, end_ns), _payloads(other, topic, end_ns), strict=False), 1
    ):
        if first != second:
            return number
    return number + 1


def _payloads(path: Path, topic: str, end_ns: int) -> Iterator[bytes]:
    with open_recorded(path) as recorded:
        for message in recorded.messages(recorded.topics.get(topic, ())):
            if message.time_ns < end_ns:
                yield message.data
