"""A valid bag out of a damaged one: every message of every chunk whose check sum agrees, once, and no other.

Of a chunk without check sum those messages are taken that can be read by their definition. The one exception is the
chunk in which a file breaks off while everything before it is sound, as a killed recorder leaves it: what it holds of
whole messages is taken too and counted apart, because no check sum vouches for it.
"""

import shutil
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field, replace
from hashlib import sha256
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from mcap.well_known import Profile
from numpy.typing import NDArray

from bags.mcap.broken_chunk import rest_of
from bags.mcap.check import Damage, mcap_files, opened, read_information, start_of
from bags.mcap.chunk import MESSAGE_HEAD, OpenChunk
from bags.mcap.errors import BagError
from bags.mcap.file_bytes import FileBytes
from bags.mcap.frames import Frame, parse_definition
from bags.mcap.kinds import ZSTD_MAGIC
from bags.mcap.mcap_file import McapFile
from bags.mcap.messages import MessageTable, chosen, walk
from bags.mcap.metadata import ROS_DISTRO, BagInfo, FileEntry, TopicEntry, write_metadata
from bags.mcap.packing import Compression
from bags.mcap.proving import Doubts, Proofs, schema_fault_of, with_sound_metadata
from bags.mcap.scan import Fault, Messages, survey
from bags.mcap.summary_section import SummarySection, summary_of
from bags.mcap.trusted import channel_fault, told_types, verified_schema
from bags.mcap.yaml_text import load

_LOOKED_AT = 1000
"""Records among which the first sound chunk is looked for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RepairReport:
    """What was recovered.

    Attributes:
        path: The repaired bag.
        messages: Messages of sound chunks.
        chunks: Sound chunks.
        salvaged: Whole messages of a chunk in which the file breaks off; no check sum vouches for them.
        undescribed: Intact messages that were left out because no record says what they are.
        left_out: The same by topic, as far as it is known, and why.
        damages: Where the bag was damaged.
    """

    path: Path
    messages: int
    chunks: int
    salvaged: int
    undescribed: int
    left_out: Mapping[str, str]
    damages: tuple[Damage, ...]

    def document(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "bag": str(self.path),
            "messages": self.messages,
            "chunks": self.chunks,
            "salvaged": self.salvaged,
            "undescribed": self.undescribed,
            "left_out": dict(self.left_out),
            "damages": [str(one) for one in self.damages],
        }


def repair(path: Path | str, out: Path | str) -> RepairReport:
    """Write a valid bag with everything that is intact in a damaged one.

    Args:
        path: The bag's directory, with or without metadata.yaml, or an MCAP file.
        out: The directory of the new bag; must not exist.

    Raises:
        BagError: Nothing to repair, or the new bag cannot be written.
    """
    path, out = Path(path), Path(out)
    named = mcap_files(path)
    if out.exists():
        raise BagError(f"{out}: exists already, expected the path of a bag to be made")
    information = read_information(path) if path.is_dir() else {}
    with ExitStack() as stack:
        return _repaired([stack.enter_context(opened(file)) for file in named], information, out)


def _repaired(files: Sequence[Path], information: Mapping[str, Any], out: Path) -> RepairReport:
    told, agreed = told_types(information), _agreed_metadata(files)
    jobs: list[_File] = []
    damages: list[Damage] = []
    try:
        out.mkdir(parents=True)
        entries: list[FileEntry] = []
        for file in files:
            last = file == files[-1]
            job = _copied(file, out / file.name, told, agreed, jobs)
            start_ns, end_ns = job.target.time_range_ns
            count = sum(job.target.counts.values())
            entries.append(FileEntry(name=file.name, start_ns=start_ns, end_ns=end_ns, count=count))
            text = _information(entries if last else entries[-1:], jobs if last else [job], information).to_yaml()
            job.target.finish({"rosbag2": {"serialized_metadata": text}})
            damages += [Damage(file=file.name, offset=one.start, what=one.what) for one in job.faults]
        write_metadata(out, text)
    except OSError as error:
        shutil.rmtree(out, ignore_errors=True)
        raise BagError(f"{out}: cannot write the bag ({error.strerror or error})") from error
    finally:
        for job in jobs:
            job.close()
    salvaged = sum(job.salvaged for job in jobs)
    return RepairReport(
        path=out,
        messages=sum(one.count for one in entries) - salvaged,
        chunks=sum(job.chunks for job in jobs),
        salvaged=salvaged,
        undescribed=sum(job.undescribed.total() for job in jobs),
        left_out=_left_out(jobs),
        damages=tuple(damages),
    )


def _left_out(jobs: "Sequence[_File]") -> dict[str, str]:
    """How many intact messages of each topic are missing in the new bag, and why."""
    counts: Counter[tuple[str, str]] = Counter()
    for job in jobs:
        for number, count in job.undescribed.items():
            topic, why = job.refused.get(number, (f"channel {number}", "nothing says on which topic they were"))
            counts[topic, why] += count
    return {topic: f"{count} messages: {why}" for (topic, why), count in counts.items()}


def _agreed_metadata(files: Sequence[Path]) -> dict[str, dict[str, str]]:
    """What most files of a bag say about each topic: readers take a topic for one only where all say the same."""
    votes: defaultdict[str, Counter[tuple[tuple[str, str], ...]]] = defaultdict(Counter)
    for file in files:
        with suppress(BagError), FileBytes(file, start_of(file)) as source:
            found = summary_of(source)
            for channel in found.channels.values() if isinstance(found, SummarySection) else ():
                sound, _ = with_sound_metadata(channel)
                votes[channel.topic][tuple(sorted(sound.metadata.items()))] += 1
    return {topic: dict(said.most_common(1)[0][0]) for topic, said in votes.items()}


def _copied(
    file: Path, path: Path, told: Mapping[str, str], agreed: dict[str, dict[str, str]], jobs: "list[_File]"
) -> "_File":
    """Copy a file, once more without what turned out to be no description of its messages.

    Args:
        file: The damaged one.
        path: The new one.
        told: Type of each topic as metadata.yaml says.
        agreed: Metadata of each topic in all files; grows.
        jobs: Copies are noted here as soon as they are begun.
    """
    base = start_of(file)
    doubts, given = Doubts(), _Given()
    while True:
        job = _File(told=told, agreed=agreed, doubts=doubts, given=given)
        jobs.append(job)
        if base:
            job.faults.append(Fault(start=0, what=f"{base} bytes stand in front of the file"))
        with FileBytes(file, base) as source:
            job.copy(source, path)
        following, late = doubts.and_those_of(job.proofs.found), job.late()
        if following == doubts and late.channels.keys() <= given.channels.keys():
            return job  # nothing new: what is left out already cannot be proved wrong once more
        doubts, given = following, late
        job.close()
        jobs.remove(job)
        path.unlink()


def _information(files: list[FileEntry], jobs: "list[_File]", old: Mapping[str, Any]) -> BagInfo:
    counts: dict[str, int] = {}
    channels: dict[str, tuple[Channel, str]] = {}
    for job in jobs:
        for channel_id, channel in job.channels.items():
            schema = job.schemas.get(channel.schema_id)
            channels.setdefault(channel.topic, (channel, schema.name if schema else job.told.get(channel.topic, "")))
            number = job.target.counts.get(job.new_ids.get(channel_id, 0), 0)
            counts[channel.topic] = counts.get(channel.topic, 0) + number
    topics = [
        TopicEntry(
            name=name,
            type_name=type_name,
            offered_qos=_profiles(channel.metadata.get("offered_qos_profiles", "")),
            type_hash=channel.metadata.get("topic_type_hash", ""),
            count=counts[name],
        )
        for name, (channel, type_name) in channels.items()
    ]
    custom = old.get("custom_data")
    texts = {str(key): str(value) for key, value in custom.items()} if isinstance(custom, dict) else {}
    return BagInfo(
        files=files,
        topics=topics,
        custom=texts,
        ros_distro=str(old.get("ros_distro") or ROS_DISTRO),
        compressed=any(job.compressed for job in jobs),
    )


def _profiles(text: str) -> list[object]:
    document = load(text) if text else []
    return document if isinstance(document, list) else []


@dataclass(frozen=True, slots=True, kw_only=True)
class _Given:
    """Definitions that an earlier copy found behind the messages that need them: the first ones are lost."""

    schemas: Mapping[int, Schema] = field(default_factory=dict)
    channels: Mapping[int, Channel] = field(default_factory=dict)


@dataclass(slots=True)
class _File:
    """One file while it is copied."""

    faults: list[Fault] = field(default_factory=list)
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    new_schemas: dict[int, int] = field(default_factory=dict)
    new_ids: dict[int, int] = field(default_factory=dict)
    chunks: int = 0
    salvaged: int = 0
    undescribed: Counter[int] = field(default_factory=Counter)  # intact messages left out, by channel
    compressed: bool = False  # whether messages are, each by itself
    told: Mapping[str, str] = field(default_factory=dict)  # type of each topic as metadata.yaml says
    agreed: dict[str, dict[str, str]] = field(default_factory=dict)  # metadata of each topic, the same in all files
    refused: dict[int, tuple[str, str]] = field(default_factory=dict)  # topics whose definition is none, and why
    described: bool = False  # whether the summary says what the messages are
    trusted: bool = False  # whether a check sum vouches for the definitions
    doubts: Doubts = field(default_factory=Doubts)  # what an earlier copy has proved wrong
    proofs: Proofs = field(default_factory=Proofs)
    given: _Given = field(default_factory=_Given)
    missed: set[int] = field(default_factory=set)  # channels of the messages that nothing described
    met: set[bytes] = field(default_factory=set)  # chunks that are copied already
    _target: McapFile | None = None

    @property
    def target(self) -> McapFile:
        """The new file."""
        if self._target is None:
            raise BagError("the new file is not open yet, expected copy() first")
        return self._target

    def close(self) -> None:
        """Close the new file, if it is open."""
        if self._target is not None:
            self._target.close()

    def late(self) -> _Given:
        """Definitions that came too late for some messages."""
        channels = {**self.given.channels, **{one: self.channels[one] for one in self.missed & self.channels.keys()}}
        wanted = {channel.schema_id for channel in channels.values()}
        return _Given(schemas={one: self.schemas[one] for one in wanted & self.schemas.keys()}, channels=channels)

    def copy(self, source: FileBytes, path: Path) -> None:
        """Copy what is sound."""
        found = summary_of(source)
        summary = found if isinstance(found, SummarySection) else None
        if summary is None:
            self.faults.append(Fault(start=source.size, what=str(found)))
        self._target = McapFile(path, _compression(source, summary), Profile.ROS2)
        self.described = summary is not None and summary.describes
        if summary is not None:
            self.proofs = Proofs(needed=not self.described)
        if summary is not None and self.described:
            self.trusted = summary.checked
            self._define(summary.schemas, summary.channels)
        self._define(self.given.schemas, self.given.channels)
        only_broken_off = summary is None
        for one in survey(source, summary):
            match one:
                case Fault(breaks_off=True) if only_broken_off:
                    self.faults.append(one)
                    content = rest_of(source, one.start)
                    self.salvaged = self._add(*content) if content is not None else 0
                case Fault():
                    self.faults.append(one)
                    only_broken_off = False
                case Messages():
                    self._definitions_in(one)
                    self._add_chunk(one)
                    only_broken_off = only_broken_off and one.indexed
                case Frame():
                    self._take(one)

    def _take(self, frame: Frame) -> None:
        match frame.opcode:
            case Opcode.SCHEMA if not self.described:
                self._define({frame.record.id: frame.record}, {})
            case Opcode.CHANNEL if not self.described:
                self._define({}, {frame.record.id: frame.record})
            case Opcode.ATTACHMENT:
                record = frame.record
                self.target.add_attachment(record.name, record.media_type, record.data)
            case Opcode.METADATA if frame.record.name != "rosbag2":
                self.target.add_metadata(frame.record.name, frame.record.metadata)
            case Opcode.MESSAGE:  # a file without chunks
                content = bytes([Opcode.MESSAGE]) + len(frame.record).to_bytes(8, "little") + frame.record
                self._add(content, walk(content))
            case _:
                pass

    def _definitions_in(self, found: Messages) -> None:
        if self.described:
            return
        for opcode, start, end in found.table.definitions:
            record = parse_definition(opcode, found.chunk.content[start:end])
            if record is not None:
                schemas, channels = ({record.id: record}, {}) if opcode == Opcode.SCHEMA else ({}, {record.id: record})
                self._define(schemas, channels)

    def _define(self, schemas: Mapping[int, Schema], channels: Mapping[int, Channel]) -> None:
        for schema in schemas.values():
            self.proofs.meet_schema(schema)
            if schema.id not in self.new_schemas:
                fault = ""
                if not self.trusted:
                    schema, fault = verified_schema(schema)  # noqa: PLW2901 - the same one, as it was
                if fault:
                    self.faults.append(Fault(start=0, what=fault))
                self.new_schemas[schema.id] = self.target.add_schema(schema.name, schema.encoding, schema.data)
                self.schemas[schema.id] = schema
        for channel in channels.values():
            self.proofs.meet_channel(channel)
            if channel.id not in self.new_ids and channel.id not in self.refused:
                self._define_channel(channel)

    def _define_channel(self, channel: Channel) -> None:
        schema = self.schemas.get(channel.schema_id)
        fault = self.doubts.about(channel)
        fault = fault or ("" if self.trusted else channel_fault(channel, schema, self.told))
        fault = fault or (schema_fault_of(channel, schema, self.told) if self.proofs.needed else "")
        if fault:
            self.refused[channel.id] = channel.topic, fault
            self.faults.append(Fault(start=0, what=fault))
            return
        channel, fault = with_sound_metadata(channel)
        agreed = self.agreed.setdefault(channel.topic, channel.metadata)
        if not fault and agreed != channel.metadata:
            fault = f"the channel of {channel.topic} says otherwise than those in other files: theirs was taken"
        if fault:
            self.faults.append(Fault(start=0, what=fault))
        channel = replace(channel, metadata=agreed)
        self.new_ids[channel.id] = self.target.add_channel(
            channel.topic, channel.message_encoding, self.new_schemas.get(channel.schema_id, 0), channel.metadata
        )
        self.channels[channel.id] = channel
        self.proofs.expect(channel, schema)

    def _add_chunk(self, found: Messages) -> None:
        """Append the messages of a chunk, unless it stood there before."""
        chunk, table = found.chunk, found.table
        name = sha256(chunk.content).digest()
        if len(table) and name in self.met:
            self.faults.append(Fault(start=chunk.start, what=f"a chunk of {len(table)} messages stands here once more"))
            return
        self.met.add(name)
        self.chunks += 1
        if not chunk.checked:
            places = zip(table.channel_ids.tolist(), table.starts.tolist(), table.ends.tolist(), strict=True)
            readable = np.array(
                [self.proofs.readable(one, chunk.content, a + MESSAGE_HEAD.size, b) for one, a, b in places], dtype=bool
            )
            if not readable.all():
                count = int(len(table) - readable.sum())
                what = f"{count} messages of a chunk without check sum cannot be read: they are left out"
                self.faults.append(Fault(start=chunk.start, what=what))
            table = chosen(table, readable)
        self._add(chunk.content, table)

    def _add(self, content: bytes, table: MessageTable) -> int:
        """Append the messages whose channels are known; return how many."""
        known = np.isin(table.channel_ids, list(self.new_ids))
        self.undescribed.update(table.channel_ids[~known].tolist())
        self.missed |= set(np.unique(table.channel_ids[~known]).tolist())
        if not known.any():
            return 0
        if not self.compressed:
            first = int(table.starts[known][0]) + MESSAGE_HEAD.size
            self.compressed = content[first : first + len(ZSTD_MAGIC)] == ZSTD_MAGIC
        starts, ends, old = table.starts[known], table.ends[known], table.channel_ids[known]
        for number, start, end in zip(old.tolist(), starts.tolist(), ends.tolist(), strict=True):
            self.proofs.read(number, content, start + MESSAGE_HEAD.size, end)
        data: NDArray[np.uint8] = np.frombuffer(content, dtype=np.uint8).copy()
        values, inverse = np.unique(old, return_inverse=True)
        new = np.array([self.new_ids[int(one)] for one in values], dtype=np.uint16)[inverse]
        data[starts + 9], data[starts + 10] = new & 0xFF, new >> 8  # the channel stands behind opcode and length
        kept = _joined(data, starts, ends)
        offsets = (np.cumsum(ends - starts) - (ends - starts)).astype(np.uint64)
        chunk = OpenChunk()
        chunk.extend(new, np.stack([table.log_times[known], offsets], axis=1), memoryview(kept))
        self.target.add_chunk(chunk)
        return len(starts)


def _joined(data: NDArray[np.uint8], starts: NDArray[np.int64], ends: NDArray[np.int64]) -> bytes:
    if starts[0] == 0 and ends[-1] == len(data) and np.array_equal(ends[:-1], starts[1:]):
        return data.tobytes()
    return b"".join(data[start:end].tobytes() for start, end in zip(starts.tolist(), ends.tolist(), strict=True))


def _compression(source: FileBytes, summary: SummarySection | None) -> Compression:
    """The compression of the file's first sound chunk, if one stands near its beginning."""
    for one in islice(survey(source, summary), _LOOKED_AT):
        if isinstance(one, Messages):
            return Compression(one.chunk.compression)
    return Compression.ZSTD
