"""The bag of a run, read by libraries that are not ours."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

PER_STEP = 42  # clock, tick, 6 states, 6 outputs, 14 received, 14 residuals


@pytest.mark.parametrize("kind", ["processes", "simulated"])
def test_rosbags_reads_every_field_of_every_message(short_runs: Mapping[str, tuple[Path, Any]], kind: str) -> None:
    """`rosbags` decodes all messages; every per-step topic has one a step, counted from the very first step on."""
    bag, _ = short_runs[kind]
    counts: Counter[str] = Counter()
    first_step: dict[str, int] = {}
    with AnyReader([bag]) as reader:
        for connection, _, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            counts[connection.topic] += 1
            if hasattr(message, "step"):
                first_step.setdefault(connection.topic, message.step)
        assert reader.message_count == counts.total()
        assert {c.topic: c.msgcount for c in reader.connections if c.msgcount} == dict(counts)
    assert sum(count == 200 for count in counts.values()) == PER_STEP
    assert all(first_step[topic] == 0 for topic, count in counts.items() if count == 200 and topic != "/clock")
    assert counts["/attacks/events"] == 2
    assert counts["/diagnostics"] == 2 * 6


def test_mcap_reads_the_same_counts(short_runs: Mapping[str, tuple[Path, Any]]) -> None:
    """`mcap` finds as many messages on each channel as the file's own statistics say."""
    bag, _ = short_runs["processes"]
    counts: Counter[str] = Counter()
    for path in bag.glob("*.mcap"):
        with path.open("rb") as stream:
            reader = make_reader(stream)
            summary = reader.get_summary()
            for _, channel, _ in reader.iter_messages():
                counts[channel.topic] += 1
    assert summary is not None
    assert summary.statistics is not None
    names = {number: channel.topic for number, channel in summary.channels.items()}
    said = {names[number]: count for number, count in summary.statistics.channel_message_counts.items() if count}
    assert said == dict(counts)
