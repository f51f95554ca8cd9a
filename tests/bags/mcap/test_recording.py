"""Several files, some topics, and disks that fill up."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from bags.mcap.bag import open_bag
from bags.mcap.check import check
from bags.mcap.errors import BagError
from bags.mcap.mcap_file import McapFile
from bags.mcap.packing import Compression
from bags.mcap.recording import Split, TopicFilter
from bags.mcap.repair import repair
from bags.mcap.writer import BagWriter
from bags.runs.reader import read_run
from bags.wire.schema import RunTopics


def _record(path: Path, topics: RunTopics, split: Split | None, compression: Compression = Compression.NONE) -> None:
    with BagWriter(
        path, topics.all, compression=compression, chunk_bytes=4000, max_chunk_age_sec=None, split=split
    ) as writer:
        layout = writer.format_of(topics.per_step)
        rows = layout.block(0, 100, topics.sampling_period_ns)
        rng = np.random.default_rng(2)
        rows["/dgu_1/state"]["x"] = rng.normal(size=(100, 3))
        writer.write_block(layout, rows)


@pytest.mark.parametrize("split", [Split(max_bytes=30_000), Split(max_duration_sec=0.3)])
def test_splits_are_one_bag(tmp_path: Path, topics: RunTopics, split: Split) -> None:
    """A split bag holds the same messages in the same order, for us and for rosbags, and keeps to its limits."""
    _record(tmp_path / "whole", topics, None)
    _record(tmp_path / "split", topics, split)
    files = sorted((tmp_path / "split").glob("*.mcap"))
    assert len(files) >= 3
    assert check(tmp_path / "split").clean, check(tmp_path / "split").damages
    one, other = read_run(tmp_path / "whole"), read_run(tmp_path / "split")
    assert one.x.tobytes() == other.x.tobytes()
    with AnyReader([tmp_path / "whole"]) as first, AnyReader([tmp_path / "split"]) as second:
        assert [(a.topic, t, bytes(d)) for a, t, d in first.messages()] == [
            (a.topic, t, bytes(d)) for a, t, d in second.messages()
        ]
        assert second.duration == first.duration
    spans = [file.end_ns - file.start_ns for file in check(tmp_path / "split").files]
    if split.max_duration_sec is not None:
        # a chunk that would exceed the limit opens the next file
        assert max(spans) < split.max_duration_sec * 1e9


def test_split_bag_after_damage(tmp_path: Path, topics: RunTopics) -> None:
    """Repair keeps the files of a split bag, whichever of them is damaged and with or without metadata.yaml."""
    _record(tmp_path / "bag", topics, Split(max_bytes=30_000))
    intact = check(tmp_path / "bag")
    shutil.copytree(tmp_path / "bag", tmp_path / "killed")
    (tmp_path / "killed" / "metadata.yaml").unlink()
    last = tmp_path / "killed" / intact.files[-1].name
    last.write_bytes(last.read_bytes()[:-2000])
    assert not check(tmp_path / "killed").clean
    report = repair(tmp_path / "killed", tmp_path / "out")
    assert check(tmp_path / "out").clean, check(tmp_path / "out").damages
    assert 0 < report.messages + report.salvaged <= intact.messages
    assert open_bag(tmp_path / "out").array("/dgu_1/state").data["step"][:80].tolist() == list(range(80))


def test_topics_left_out(tmp_path: Path, topics: RunTopics) -> None:
    """Messages on topics that the filter refuses are taken and left out, singly and in blocks."""
    chosen = TopicFilter(include=(r"/dgu_\d/.*", "/tick"), exclude=(r".*/residual/.*",))
    with BagWriter(tmp_path / "bag", topics.all, topic_filter=chosen) as writer:
        layout = writer.format_of(topics.per_step)
        rows = layout.block(0, 5, topics.sampling_period_ns)
        rows["/dgu_2/state"]["x"] = 2.0
        writer.write_block(layout, rows)
        writer.write("/clock", 0, topics.clock().encode(0))
        with pytest.raises(BagError, match="message on /nothing"):
            writer.write("/nothing", 0, b"")
    bag = open_bag(tmp_path / "bag")
    assert "/clock" not in bag.topics
    assert not [name for name in bag.topics if "residual" in name]
    assert bag.array("/tick").data["step"].tolist() == list(range(5))
    assert bag.array("/dgu_2/state").data["x"].tolist() == [[2.0] * 3] * 5
    assert check(tmp_path / "bag").clean


def test_wrong_limits_are_named() -> None:
    """Limits that no file can keep and patterns that are none are one line each."""
    with pytest.raises(BagError, match="max_bytes is 0, expected a positive number"):
        Split(max_bytes=0)
    with pytest.raises(BagError, match="expected a regular expression"):
        TopicFilter(exclude=("(",))


FILLING = """
import resource, sys
from pathlib import Path
from bags.mcap.errors import BagError
from bags.mcap.recording import Split
from bags.wire.schema import run_topics
from bags.mcap.writer import BagWriter
from dgu_sim.grid import Link
topics = run_topics((1, 2), (Link(1, 2),), 10_000_000)
for limit in (60_000, 60_700, 66_000, 80_000):
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
    writer = BagWriter(Path(sys.argv[1]) / str(limit), topics.all, chunk_bytes=3000, max_chunk_age_sec=None)
    try:
        for step in range(100_000):
            writer.write("/tick", topics.stamp_ns(step), topics.tick().encode(step))
    except BagError as error:
        print(error)
    writer.close()
"""


def test_full_disk_leaves_a_valid_bag(tmp_path: Path) -> None:
    """When a file cannot grow, recording ends with an error and the bag is valid up to a chunk before it."""
    done = subprocess.run([sys.executable, "-c", FILLING, str(tmp_path)], capture_output=True, text=True, check=True)
    lines = done.stdout.splitlines()
    assert len(lines) == 4
    for line, limit in zip(lines, (60_000, 60_700, 66_000, 80_000), strict=True):
        assert "cannot write the bag (File too large); it is closed and valid up to" in line
        report = check(tmp_path / str(limit))
        assert report.clean, report.damages
        assert f"{report.messages} messages" in line
        steps = open_bag(tmp_path / str(limit)).array("/tick").data["step"]
        assert steps.tolist() == list(range(report.messages))


def test_no_room_for_the_next_file(tmp_path: Path, topics: RunTopics, monkeypatch: pytest.MonkeyPatch) -> None:
    """When a disk fills up right behind a split, the bag is the files before it."""
    writer = BagWriter(
        tmp_path / "bag", topics.all, chunk_bytes=1000, max_chunk_age_sec=None, split=Split(max_bytes=20_000)
    )

    def refuse(*_: object) -> None:
        raise OSError(28, os.strerror(28))

    def fill() -> None:
        for step in range(100_000):
            if len(list((tmp_path / "bag").glob("*.mcap"))) == 3:
                monkeypatch.setattr(McapFile, "add_packed", refuse)
                monkeypatch.setattr(McapFile, "finish", refuse)
                monkeypatch.setattr(McapFile, "drop_last_chunk", lambda _: False)
            writer.write("/tick", topics.stamp_ns(step), topics.tick().encode(step))

    with pytest.raises(BagError, match="No space left on device"):
        fill()
    report = check(tmp_path / "bag")
    assert (report.clean, len(report.files)) == (True, 2)
    assert open_bag(tmp_path / "bag").array("/tick").data["step"].tolist() == list(range(report.messages))
