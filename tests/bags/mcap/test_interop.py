"""What we write, read by three libraries that are not ours: as recorded, in several files, and after a repair."""

from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from bags.mcap.bag import open_bag
from bags.mcap.check import check
from bags.mcap.packing import Compression
from bags.mcap.recording import ChunkPreset, Recording, Split
from bags.mcap.repair import repair
from bags.runs.offline import simulate_to_bag
from bags.runs.reader import read_run
from dgu_sim.scenario import Scenario

Found = tuple[Counter[str], dict[tuple[str, int], list[float]]]


def _taken(counts: Counter[str], residuals: dict[tuple[str, int], list[float]], topic: str, message: Any) -> None:  # noqa: ANN401 - classes made at run time
    counts[topic] += 1
    if "/residual/" in topic:
        residuals[topic, int(message.step)] = [float(one) for one in message.residual]


def by_rosbags(bag: Path) -> Found:
    """Every message of a bag, decoded by rosbags."""
    counts: Counter[str] = Counter()
    residuals: dict[tuple[str, int], list[float]] = {}
    with AnyReader([bag]) as reader:
        for connection, _, data in reader.messages():
            _taken(counts, residuals, connection.topic, reader.deserialize(data, connection.msgtype))
    return counts, residuals


def by_mcap_ros2(bag: Path) -> Found:
    """Every message of its files, decoded by mcap and mcap-ros2-support from the schemas in them."""
    counts: Counter[str] = Counter()
    residuals: dict[tuple[str, int], list[float]] = {}
    for file in bag.glob("*.mcap"):
        with file.open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
            for _, channel, _, message in reader.iter_decoded_messages():
                _taken(counts, residuals, channel.topic, message)
    return counts, residuals


@pytest.fixture(scope="module")
def variants(scenario: Scenario, bag: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A bag as recorded, one in several files with another compression, and one that was cut off and repaired."""
    folder = tmp_path_factory.mktemp("variants")
    several = Recording(compression=Compression.LZ4, chunks=ChunkPreset.SAFE, split=Split(max_duration_sec=0.5))
    split = simulate_to_bag(scenario, folder / "split", recording=several)
    assert len(list(split.glob("*.mcap"))) > 3
    killed = simulate_to_bag(scenario, folder / "killed", recording=several)
    (killed / "metadata.yaml").unlink()
    last = max(killed.glob("*.mcap"))
    last.write_bytes(last.read_bytes()[: last.stat().st_size * 2 // 3])
    repair(killed, folder / "repaired")
    assert check(folder / "repaired").clean
    return {"as recorded": bag, "split": split, "repaired": folder / "repaired"}


@pytest.mark.parametrize("library", [by_rosbags, by_mcap_ros2])
@pytest.mark.parametrize("variant", ["as recorded", "split", "repaired"])
def test_others_read_every_message(variants: dict[str, Path], variant: str, library: Callable[[Path], Found]) -> None:
    """They find the messages that we find, on each topic as many, and decode the residuals to the same bits."""
    counts, residuals = library(variants[variant])
    ours = {name: topic.count for name, topic in open_bag(variants[variant]).topics.items() if topic.count}
    assert dict(counts) == ours
    run = read_run(variants[variant])
    assert 200 < run.steps <= 240
    for position, link in enumerate(run.links):
        topic = run.topics.residual(link).topic.name
        found = np.array([residuals[topic, step] for step in range(run.steps)])
        assert found.tobytes() == np.ascontiguousarray(run.residual[:, position]).tobytes()
