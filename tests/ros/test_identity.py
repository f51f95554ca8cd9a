"""Same scenario and seed: the same numbers, bit for bit, however the run is carried out."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from mcap.reader import make_reader

from bags.runs.reader import read_run
from bags.runs.replay import replay

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path


def payloads(bag: Path) -> dict[str, list[bytes]]:
    """Payload bytes of every topic, in the order of the file."""
    found: dict[str, list[bytes]] = {}
    for path in sorted(bag.glob("*.mcap")):
        with path.open("rb") as stream:
            for _, channel, message in make_reader(stream).iter_messages(log_time_order=False):
                found.setdefault(channel.topic, []).append(message.data)
    return found


@pytest.mark.parametrize("other", ["processes again", "composed", "simulated"])
def test_every_topic_carries_the_same_bytes(short_runs: Mapping[str, tuple[Path, Any]], other: str) -> None:
    """Processes, processes again, one process and no ROS at all write the same payloads, message for message."""
    expected, found = payloads(short_runs["processes"][0]), payloads(short_runs[other][0])
    assert {topic: len(data) for topic, data in found.items()} == {t: len(data) for t, data in expected.items()}
    assert [topic for topic in expected if found[topic] != expected[topic]] == []


@pytest.mark.parametrize("kind", ["processes", "composed", "simulated"])
def test_replay_repeats_the_residuals(short_runs: Mapping[str, tuple[Path, Any]], kind: str) -> None:
    """Freshly designed monitors on the recorded received outputs conclude exactly what the run's monitors did."""
    recorded = read_run(short_runs[kind][0])
    replayed = replay(recorded)
    assert np.isfinite(recorded.residual).all()
    for name in ("residual", "estimate", "threshold", "phase", "alarm"):
        np.testing.assert_array_equal(getattr(replayed, name), getattr(recorded, name))


def test_the_printed_document_names_the_attacked_link_alone(short_runs: Mapping[str, tuple[Path, Any]]) -> None:
    """`--json` prints one document, in which link 1-2 is attacked and noticed within three samples and no other is."""
    bag, finished = short_runs["processes"]
    document = json.loads(finished.out)
    assert (document["scenario"], document["steps"], document["bag"]) == ("short", 200, str(bag))
    assert len(document["links"]) == 14
    (attack,) = document["attacks"]
    assert (attack["links"], attack["from_sec"], attack["accused_by"]) == (["1-2"], 1.0, "1-2")
    assert 0.0 <= attack["delay_sec"] <= 0.03
    quiet = [link for link in document["links"] if not link["attacks"]]
    assert [link["first_alarm_sec"] for link in quiet] == [None] * 13


def test_replay_command_prints_the_same_links(
    short_runs: Mapping[str, tuple[Path, Any]], dcmg: Callable[..., Any]
) -> None:
    """`dcmg replay` of a bag prints the table of the run that wrote it."""
    bag, finished = short_runs["processes"]
    again = dcmg("replay", bag, "--json")
    assert again.code == 0, again.err
    assert json.loads(again.out)["links"] == json.loads(finished.out)["links"]
