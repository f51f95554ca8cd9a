"""Spoofed links in bags: both messages, what was taken, what the guards say."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from numpy.typing import NDArray

from bags.mcap.bag import open_bag
from bags.mcap.cdr import Layout
from bags.mcap.writer import BagWriter
from bags.runs.offline import simulate_to_bag
from bags.runs.reader import open_run, read_run
from bags.runs.replay import replay
from bags.runs.run_record import RunRecord
from bags.watch.scenarios import parse_scenario
from dgu_sim.grid import Link
from dgu_sim.records import Sample
from dgu_sim.scenario import Scenario
from dgu_sim.simulate import simulate

LINK = Link(1, 2)
PHI = (0.0, 0.5, 0.0)
SPOOF = f"{{kind: spoof, link: 1-2, start_sec: 1.0, stop_sec: 1.5, falsify: {{kind: bias, bias: {list(PHI)}}}}}"
DROP = "{kind: drop, link: 3-1, start_sec: 1.2, stop_sec: 1.3}"


def _spoofed(scenario: Scenario, *overrides: str) -> Scenario:
    return parse_scenario(scenario.to_yaml(), overrides=[f"attacks=[{SPOOF}, {DROP}]", *overrides])


def _messages(bag: Path) -> list[tuple[str, int, bytes]]:
    """Topic, stamp and payload of every message in the order of the file."""
    (path,) = bag.glob("*.mcap")
    with path.open("rb") as stream:
        found = make_reader(stream).iter_messages(log_time_order=False)
        return [(channel.topic, message.log_time, message.data) for _, channel, message in found]


@pytest.fixture(name="spoofed", scope="module")
def _record(scenario: Scenario, tmp_path_factory: pytest.TempPathFactory) -> RunRecord:
    return read_run(simulate_to_bag(_spoofed(scenario), tmp_path_factory.mktemp("spoofed") / "run"))


def test_both_messages_are_in_the_bag(spoofed: RunRecord) -> None:
    """The link's own message says what the DGU sent; the second one stands beside it, for the spoofed steps only."""
    assert [(one.step, one.link, one.delivered) for one in spoofed.seconds] == [
        (step, LINK, True) for step in range(100, 150)
    ]
    own = spoofed.topics.received(LINK)
    messages = [own.decode(data)[1].y for _, data in open_bag(spoofed.path).messages(own.topic.name)]
    np.testing.assert_array_equal(messages, spoofed.y[:, 0])
    for one in spoofed.seconds:
        np.testing.assert_array_equal(one.y, spoofed.y[one.step, 0] + PHI)


def test_what_was_taken_is_what_the_monitors_saw(scenario: Scenario, spoofed: RunRecord) -> None:
    """`received` is what steered the DGUs; replay repeats the residuals from it bit for bit."""
    (block,) = simulate(_spoofed(scenario))
    np.testing.assert_array_equal(spoofed.received, block.received[:, 0])
    np.testing.assert_array_equal(spoofed.delivered, block.delivered[:, 0])
    again = replay(spoofed)
    for name in ("residual", "threshold", "alarm", "phase"):
        np.testing.assert_array_equal(getattr(again, name), getattr(spoofed, name))


def test_the_guards_tell_the_second_publisher_and_the_losses(spoofed: RunRecord) -> None:
    """Two faults, each told when it appears and when it is over."""
    assert [(one.step, one.source, one.monitor, one.kind, one.active) for one in spoofed.streams] == [
        (100, 1, 2, "second_publisher", True),
        (120, 3, 1, "missing", True),
        (130, 3, 1, "missing", False),
        (150, 1, 2, "second_publisher", False),
    ]


def test_short_blocks_tell_the_same(scenario: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """However many steps are simulated at once, the bag holds the same messages in the same order."""
    bags = []
    for size in (7, 500):
        monkeypatch.setattr("bags.runs.offline._BLOCK_STEPS", size)
        path = simulate_to_bag(_spoofed(scenario), tmp_path / str(size))
        bags.append(_messages(path))
    assert bags[0] == bags[1]


def test_who_knows_its_publisher_took_the_true_message(scenario: Scenario, tmp_path: Path) -> None:
    """With receiver.accept known_publisher, what was taken is what was sent, and the guard tells all the same."""
    run = _spoofed(scenario, "receiver.accept=known_publisher")
    record = read_run(simulate_to_bag(run, tmp_path / "run"))
    link = record.links.index(LINK)
    np.testing.assert_array_equal(record.received[:, link], record.y[:, 0])
    assert len(record.seconds) == 50
    assert "second_publisher" in {one.kind for one in record.streams}


def test_what_an_outsider_published_is_kept_and_never_taken(record: RunRecord, bag: Path, tmp_path: Path) -> None:
    """Messages of nobody's attack, even broken ones, leave the run as it was."""
    codec = record.topics.second(LINK)
    with BagWriter(tmp_path / "bag", [*record.topics.all, codec.topic]) as writer:
        for topic, stamp_ns, data in _messages(bag):
            writer.write(topic, stamp_ns, data)
        writer.write(codec.topic.name, 0, codec.encode(10, Sample(y=(1.0, 2.0, 3.0))))
        writer.write(codec.topic.name, 0, b"\x00\x01\x00\x00nonsense")
    again = read_run(tmp_path / "bag")
    assert [(one.step, one.y) for one in again.seconds] == [(10, (1.0, 2.0, 3.0))]
    np.testing.assert_array_equal(again.received, record.received)


def test_second_messages_are_decoded_once(spoofed: RunRecord, monkeypatch: pytest.MonkeyPatch) -> None:
    """However many windows a run is read in, the messages of second publishers are gone through once."""
    read, decoded = Layout.read, []

    def counted(layout: Layout, payloads: Iterable[bytes]) -> NDArray[np.void]:
        decoded.append(layout)
        return read(layout, payloads)

    monkeypatch.setattr(Layout, "read", counted)
    windows = list(open_run(spoofed.path).windows(7))
    assert len(windows) > 30
    assert len(decoded) == 1
    assert tuple(one for window in windows for one in window.seconds) == spoofed.seconds
    np.testing.assert_array_equal(np.concatenate([one.received for one in windows]), spoofed.received)
