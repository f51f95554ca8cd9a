"""The run without ROS against nodes played by hand."""

from pathlib import Path

import pytest
from rosbags.highlevel import AnyReader

from bags.mcap.writer import BagWriter
from bags.runs.offline import simulate_to_bag
from bags.runs.reader import read_run
from bags.watch.scenarios import parse_scenario
from bags.wire.convert import design_record, history_of, history_records
from bags.wire.schema import RunTopics
from bags.wire.settings import settings_of
from dgu_sim.experiment import run_experiments
from dgu_sim.records import Physical, Sample
from dgu_sim.scenario import Scenario
from dgu_sim.simulate import relay_of
from dgu_sim.unit import unit_of
from monitor import detectors
from monitor.link_design import design_link
from monitor.link_monitor import MonitorOutput


class _Nodes:
    """Clock, DGUs, attacker and monitors of a run in Python floats, each fed with wire bytes like a node."""

    def __init__(self, scenario: Scenario, topics: RunTopics, bag: BagWriter) -> None:
        self.topics, self.bag = topics, bag
        self.units = {dgu: unit_of(scenario, dgu) for dgu in topics.dgus}
        self.unit_states = {dgu: unit.init() for dgu, unit in self.units.items()}
        self.relay, self.relay_state = relay_of(scenario)
        settings = settings_of(scenario)
        histories = {dgu: history_records(dgu, run_experiments(scenario, dgu)) for dgu in topics.dgus}
        for dgu, records in histories.items():
            for record in records:
                bag.write(topics.history(dgu).topic.name, 0, topics.history(dgu).encode(record))
        self.monitors = []
        for link in topics.links:
            codec = topics.history(link.source)
            received = history_of([codec.decode(codec.encode(record)) for record in histories[link.source]])
            design = design_link(settings.observer.kind, received, settings.observer.options)
            detector = detectors.build(settings.detector.kind, settings.detector.options, scenario.sampling_period_sec)
            self.monitors.append(design.monitor(detector))
            told = design_record(design, link.source, link.target)
            bag.write(topics.design(link).topic.name, 0, topics.design(link).encode(told))
        self.monitor_states = [one.init() for one in self.monitors]
        self.alarms = [False] * len(topics.links)

    def step(self, k: int) -> None:
        """One step in canonical order."""
        topics = self.topics
        self._write(k, "/clock", topics.clock().encode(k))
        self._write(k, "/tick", topics.tick().encode(k))
        outputs = {dgu: unit.output(self.unit_states[dgu]) for dgu, unit in self.units.items()}
        physical: dict[int, Physical] = {}
        for dgu, output in outputs.items():
            data = topics.state(dgu).encode(k, output)
            physical[dgu] = topics.state(dgu).decode(data)[1]
            self._write(k, topics.state(dgu).topic.name, data)
        sent: list[Sample] = []
        for dgu, output in outputs.items():
            data = topics.output(dgu).encode(k, Sample(y=output.y))
            sent.append(topics.output(dgu).decode(data)[1])
            self._write(k, topics.output(dgu).topic.name, data)
        self.relay_state, samples, events = self.relay.step(self.relay_state, sent)
        received = []
        for link, sample in zip(topics.links, samples, strict=True):
            data = topics.received(link).encode(k, sample)
            received.append(topics.received(link).decode(data)[1])
            self._write(k, topics.received(link).topic.name, data)
        verdicts = self._watch(k, received)
        for event in events:
            self._write(k, "/attacks/events", topics.attack_events().encode(event))
        self._diagnose(k, verdicts)
        by_link = dict(zip(topics.links, received, strict=True))
        for dgu, unit in self.units.items():
            heard = [by_link[link] for link in topics.links if link.target == dgu]
            felt = [physical[other] for other in unit.physical]
            self.unit_states[dgu] = unit.step(self.unit_states[dgu], felt, heard)

    def _watch(self, k: int, received: list[Sample]) -> list[MonitorOutput]:
        verdicts = []
        for position, (link, sample) in enumerate(zip(self.topics.links, received, strict=True)):
            monitor, state = self.monitors[position], self.monitor_states[position]
            self.monitor_states[position], verdict = monitor.step(state, list(sample.y), sample.delivered)
            self._write(k, self.topics.residual(link).topic.name, self.topics.residual(link).encode(k, verdict))
            verdicts.append(verdict)
        for position, link in enumerate(self.topics.links):
            if verdicts[position].alarm != self.alarms[position]:
                codec = self.topics.alarms(link.target)
                self._write(k, codec.topic.name, codec.encode(k, link.source, verdicts[position]))
                self.alarms[position] = bool(verdicts[position].alarm)
        return verdicts

    def _diagnose(self, k: int, verdicts: list[MonitorOutput]) -> None:
        for monitor in self.topics.monitors:
            codec = self.topics.diagnostics(monitor)
            if codec.due(k):
                own = [verdicts[at] for at, link in enumerate(self.topics.links) if link.target == monitor]
                self._write(k, "/diagnostics", codec.encode(k, own))

    def _write(self, k: int, name: str, data: bytes) -> None:
        self.bag.write(name, self.topics.stamp_ns(k), data)


def test_same_messages_as_nodes(bag: Path, scenario: Scenario, topics: RunTopics, tmp_path: Path) -> None:
    """Arrays over DGUs and links, written in blocks, leave the very bytes of floats in nodes, in the same order."""
    with BagWriter(tmp_path / "nodes", topics.all) as other:
        nodes = _Nodes(scenario, topics, other)
        for k in range(scenario.steps):
            nodes.step(k)
    with AnyReader([bag]) as ours, AnyReader([tmp_path / "nodes"]) as theirs:
        for (one, one_stamp, one_data), (two, two_stamp, two_data) in zip(
            ours.messages(), theirs.messages(), strict=True
        ):
            assert (one.topic, one_stamp) == (two.topic, two_stamp)
            assert bytes(one_data) == bytes(two_data), f"{one.topic} at {one_stamp} ns"


def test_two_runs_are_one_file(bag: Path, scenario: Scenario, tmp_path: Path) -> None:
    """The same scenario and seed give the same file, byte for byte."""
    again = simulate_to_bag(scenario, tmp_path / "run")
    assert (again / "run_0.mcap").read_bytes() == (bag / "run_0.mcap").read_bytes()


def test_seed_matters(bag: Path, scenario: Scenario, tmp_path: Path) -> None:
    """Another seed is another run."""
    other = parse_scenario(scenario.to_yaml(), overrides=["seed=8"])
    again = simulate_to_bag(other, tmp_path / "run")
    assert (again / "run_0.mcap").read_bytes() != (bag / "run_0.mcap").read_bytes()


def test_progress_is_told(scenario: Scenario, tmp_path: Path) -> None:
    """The display hears of every block, at last of all steps."""
    told: list[int] = []
    simulate_to_bag(scenario, tmp_path / "run", told.append)
    assert told == sorted(told)
    assert told[-1] == scenario.steps


def test_interrupted_simulation_leaves_a_bag(scenario: Scenario, tmp_path: Path) -> None:
    """Ctrl-C ends the simulation; what was done is in a closed bag."""
    longer = parse_scenario(scenario.to_yaml(), overrides=["duration_sec=30"])

    def interrupt(_steps: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate_to_bag(longer, tmp_path / "run", interrupt)
    assert 0 < read_run(tmp_path / "run").steps < longer.steps


def test_run_without_links(scenario: Scenario, tmp_path: Path) -> None:
    """DGUs that do not talk to each other are simulated and recorded, with nothing to monitor."""
    alone = parse_scenario(
        scenario.to_yaml(),
        overrides=["lines=[]", "attacks=[]", "coupling=isolated", "secondary.enabled=false", "duration_sec=0.1"],
    )
    record = read_run(simulate_to_bag(alone, tmp_path / "run"))
    assert (record.steps, record.links, record.received.shape) == (10, (), (10, 0, 3))
