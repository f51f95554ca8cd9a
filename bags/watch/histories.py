"""Offline experiments as a bag of their own."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bags.mcap.container import open_container, readable
from bags.mcap.errors import BagError
from bags.mcap.writer import BagWriter
from bags.wire.convert import history_records
from bags.wire.documents import HistoryCodec
from bags.wire.origin import attach_origin
from bags.wire.records import GRID, HistoryRecord
from bags.wire.schema import run_topics, topics_of
from bags.wire.settings import settings_of
from dgu_sim.experiment import run_experiments
from dgu_sim.grid_experiment import run_grid_experiments
from dgu_sim.poisoning import poisoned
from dgu_sim.scenario import Scenario

_HISTORY_TOPIC = re.compile(r"/dgu_(\d+)/history")


def histories_of_run(scenario: Scenario, dgu: int) -> list[HistoryRecord]:
    """The history of one DGU that the monitors of a run are designed from: recorded, or from an experiment done now.

    Args:
        scenario: Its `history` section says which.
        dgu: Number of the DGU.

    Raises:
        BagError: The bag of histories cannot be read or holds none of this DGU.
        dgu_sim.errors.ScenarioError: The scenario has no such DGU.
    """
    records = true_histories(scenario, dgu)
    if all(poison.dgu != dgu for poison in scenario.poison):
        return records
    falsified = poisoned(scenario, dgu, [record.x for record in records])
    made_up = [records[0]] * (len(falsified) - len(records))
    return [
        replace(true, experiment=number, experiments=len(falsified), x=x, y=_as_sent(true, x))
        for number, (true, x) in enumerate(zip([*records, *made_up], falsified, strict=True))
    ]


def true_histories(scenario: Scenario, dgu: int) -> list[HistoryRecord]:
    """The history of one DGU before anybody falsified it; raises what `histories_of_run` does."""
    if scenario.history.bag is None:
        return history_records(dgu, run_experiments(scenario, dgu))
    return read_histories(Path(scenario.history.bag), dgu)


def recorded_states(scenario: Scenario) -> dict[int, list[NDArray[np.float64]]] | None:
    """What attackers who know the victims' histories need to be given: the states that are in `history.bag`.

    Raises:
        BagError: The bag cannot be read or lacks a DGU whose links are attacked.
    """
    if scenario.history.bag is None:
        return None
    attacked = {link.source for attack in scenario.attacks for link in attack.plan.links}
    return {dgu: [record.x for record in true_histories(scenario, dgu)] for dgu in sorted(attacked)}


def _as_sent(record: HistoryRecord, x: NDArray[np.float64]) -> NDArray[np.float64]:
    """The outputs that belong to falsified states: y = x where it is sent.

    Raises:
        BagError: The record's outputs are not its states.
    """
    sent = np.isfinite(record.y)
    if record.y.shape != record.x.shape or not np.array_equal(record.y[sent], record.x[sent]):
        raise BagError(f"poison of DGU {record.dgu}: expected a history whose outputs are its states")
    return np.where(sent, x, np.nan)


def read_histories(path: Path | str, dgu: int) -> list[HistoryRecord]:
    """The recorded experiments on one DGU, in a bag of histories or of a run.

    Raises:
        BagError: The bag cannot be read or holds no history of this DGU.
    """
    path = Path(path)
    return _recorded(path, run_topics((dgu,), (), 1).history(dgu), f"DGU {dgu}")


def grid_history_of_run(scenario: Scenario) -> list[HistoryRecord]:
    """The history of the whole grid that a team of monitors is designed from, like `histories_of_run`.

    Raises:
        BagError: The bag of histories cannot be read or holds none of the grid.
    """
    if scenario.history.bag is None:
        team = settings_of(scenario).team
        samples = scenario.history.samples if team is None else team.samples
        return history_records(GRID, run_grid_experiments(scenario, samples))
    return _recorded(Path(scenario.history.bag), grid_history_codec(scenario), "the whole grid")


def grid_history_codec(scenario: Scenario) -> HistoryCodec:
    """Codec of /grid/history."""
    return topics_of(scenario).grid_history()


def _recorded(path: Path, codec: HistoryCodec, what: str) -> list[HistoryRecord]:
    records: list[HistoryRecord] = []
    for channels, chunk in open_container(path).chunks():
        with readable(path):
            for channel_id in chunk.offsets:
                if channels[channel_id].topic == codec.topic.name:
                    records += [codec.decode(payload) for payload in chunk.payloads(channel_id)]
    if not records:
        raise BagError(f"{path}: holds nothing on {codec.topic.name}, expected a recorded history of {what}")
    return records


def read_all_histories(path: Path | str) -> list[HistoryRecord]:
    """The recorded experiments on every DGU in a bag.

    Raises:
        BagError: The bag cannot be read or holds no history.
    """
    path = Path(path)
    names = open_container(path).topics
    dgus = sorted(int(match[1]) for name in names if (match := _HISTORY_TOPIC.fullmatch(name)))
    if not dgus:
        raise BagError(f"{path}: holds no topic /dgu_1/history or the like, expected recorded histories")
    return [record for dgu in dgus for record in read_histories(path, dgu)]


def write_histories(scenario: Scenario, dgus: Sequence[int], path: Path | str) -> Path:
    """Run the offline experiments of some DGUs and record them on the topics of a run.

    Args:
        scenario: Its `history` section says how; the seed is its own.
        dgus: Numbers of the DGUs.
        path: The bag's directory; must not exist.

    Returns:
        The path.

    Raises:
        BagError: The bag cannot be written.
        dgu_sim.errors.ScenarioError: The scenario has no such DGU.
    """
    path = Path(path)
    topics = run_topics(scenario.grid.dgus, scenario.links, scenario.sampling_period_ns)
    found = [(topics.history(dgu), histories_of_run(scenario, dgu)) for dgu in dgus]
    if topics_of(scenario).team is not None:
        found.append((grid_history_codec(scenario), grid_history_of_run(scenario)))
    with BagWriter(path, [codec.topic for codec, _ in found]) as writer:
        attach_origin(writer, scenario)
        for codec, records in found:
            for record in records:
                writer.write(codec.topic.name, 0, codec.encode(record))
    return path
