"""Small sound bags of every make, and what is in them."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import TYPE_CHECKING

import numpy as np
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Channel, Chunk
from mcap.records import Message as RawMessage
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import CompressionType, Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as OtherWriter
from rosbags.typesys import Stores, get_typestore

from bags.golden import golden_path
from bags.mcap.packing import Compression
from bags.mcap.recording import Split
from bags.mcap.writer import BagWriter
from bags.wire.schema import run_topics
from dgu_sim.grid import Link

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

Message = tuple[str, int, bytes]
_STEPS = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class Original:
    """A sound bag.

    Attributes:
        name: its make.
        folder: the bag.
        messages: topic, time and bytes of every message.
        chunks: of each file: start of each chunk, end of its message index, and its messages.
        ours: whether this project recorded it.
        checked: whether its chunks have check sums.
    """

    name: str
    folder: Path
    messages: tuple[Message, ...]
    chunks: Mapping[str, tuple[tuple[int, int, tuple[Message, ...]], ...]]
    ours: bool
    checked: bool


def files_of(bag: Path) -> list[Path]:
    """Its MCAP files."""
    return sorted(bag.glob("*.mcap"))


def messages_of(bag: Path) -> list[Message]:
    """Every message as the mcap library reads it, check sums verified."""
    found = []
    for file in files_of(bag):
        with file.open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True)
            messages = reader.iter_messages(log_time_order=False)
            found += [(channel.topic, one.log_time, one.data) for _, channel, one in messages]
    return found


@cache
def originals() -> tuple[Original, ...]:
    """One bag of each make, for the time of this process."""
    folder = Path(mkdtemp(prefix="dcmg_originals_"))
    return tuple(_original(name, make(folder / name)) for name, make in _MAKES.items())


def _original(name: str, bag: Path) -> Original:
    chunks = {file.name: tuple(_chunks(file)) for file in files_of(bag)}
    return Original(
        name=name,
        folder=bag,
        messages=tuple(messages_of(bag)),
        chunks=chunks,
        ours=name.startswith("dcmg"),
        checked=all(_has_check_sum(file, start) for file in files_of(bag) for start, _, _ in chunks[file.name]),
    )


def _has_check_sum(file: Path, chunk: int) -> bool:
    return file.read_bytes()[chunk + 33 : chunk + 37] != bytes(4)  # behind opcode, length, times and size


def _chunks(file: Path) -> list[tuple[int, int, tuple[Message, ...]]]:
    """Start, end and messages of each chunk."""
    places, at, data = [], 8, file.read_bytes()
    while at < len(data) - 8:
        opcode, length = struct.unpack_from("<BQ", data, at)
        start, at = at, at + 9 + length
        if opcode == Opcode.CHUNK:
            places.append((start, at))
        elif opcode == Opcode.MESSAGE_INDEX:
            places[-1] = (places[-1][0], at)
    topics: dict[int, str] = {}
    contents: list[tuple[Message, ...]] = []
    with file.open("rb") as stream:
        for record in StreamReader(stream, emit_chunks=True).records:
            inner = breakup_chunk(record) if isinstance(record, Chunk) else [record]
            topics |= {one.id: one.topic for one in inner if isinstance(one, Channel)}
            if isinstance(record, Chunk):
                messages = [one for one in inner if isinstance(one, RawMessage)]
                contents.append(tuple((topics[one.channel_id], one.log_time, one.data) for one in messages))
    return [(start, end, content) for (start, end), content in zip(places, contents, strict=True)]


def _ours(path: Path, compression: Compression, split: Split | None = None) -> Path:
    topics = run_topics((1, 2), (Link(1, 2), Link(2, 1)), 10_000_000)
    few = [topics.tick().topic, topics.state(1).topic, topics.received(topics.links[0]).topic]
    rng = np.random.default_rng(3)
    with BagWriter(path, few, compression=compression, chunk_bytes=700, max_chunk_age_sec=None, split=split) as writer:
        writer.attach("note", b"text")
        layout = writer.format_of(few)
        rows = layout.block(0, _STEPS, topics.sampling_period_ns)
        rows[few[1].name]["x"] = rng.normal(size=(_STEPS, 3))
        rows[few[2].name]["y"] = rng.normal(size=(_STEPS, 3))
        writer.write_block(layout, rows)
    return path


def _run(path: Path) -> Path:
    """A whole run: definitions of 76 topics, attachments, latched documents."""
    path.symlink_to(golden_path("biased"))
    return path


def _library(path: Path) -> Path:
    """As the mcap library writes it, definitions in the chunks, without metadata.yaml."""
    path.mkdir()
    with (path / "library_0.mcap").open("wb") as stream:
        writer = Writer(stream, chunk_size=300, compression=CompressionType.LZ4)
        writer.start("ros2", "test")
        schema = writer.register_schema("std_msgs/msg/UInt32", "ros2msg", b"uint32 data")
        channel = writer.register_channel("/chatter", "cdr", schema)
        for number in range(40):
            writer.add_message(channel, number, b"\0\1\0\0" + number.to_bytes(4, "little"), number)
        writer.finish()  # type: ignore[no-untyped-call] # mcap leaves it without a type
    return path


def _other(path: Path) -> Path:
    """As rosbags writes it."""
    store = get_typestore(Stores.ROS2_JAZZY)
    with OtherWriter(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/words", "std_msgs/msg/String", typestore=store)
        kind = store.types["std_msgs/msg/String"]
        for number in range(40):
            data = store.serialize_cdr(kind(data=f"word {number}"), "std_msgs/msg/String")
            writer.write(connection, number * 1_000_000, data)
    return path


_MAKES: Mapping[str, Callable[[Path], Path]] = {
    "dcmg, zstd": lambda path: _ours(path, Compression.ZSTD),
    "dcmg, lz4": lambda path: _ours(path, Compression.LZ4),
    "dcmg, not compressed": lambda path: _ours(path, Compression.NONE),
    "dcmg, split": lambda path: _ours(path, Compression.ZSTD, Split(max_bytes=2500)),
    "dcmg, a run": _run,
    "mcap library": _library,
    "rosbags": _other,
}
