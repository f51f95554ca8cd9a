"""Reading a rosbag2 directory of MCAP files chunk by chunk, each channel's messages as one numpy array."""

import struct
import zlib
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel
from numpy.typing import NDArray

from bags.mcap.chunk import ENTRY_BYTES, INDEX_HEAD, MESSAGE_HEAD, MESSAGE_HEAD_LENGTH
from bags.mcap.chunk_table import ChunkEntry
from bags.mcap.definitions import Definition
from bags.mcap.errors import BagError
from bags.mcap.expand import expand
from bags.mcap.file_bytes import FileBytes
from bags.mcap.folder import named_files, read_metadata
from bags.mcap.frames import read_frame
from bags.mcap.messages import walk
from bags.mcap.metadata import METADATA_FILE
from bags.mcap.summary_section import SummarySection, summary_of

_CHUNK_HEAD = struct.Struct("<BQQQQII")  # opcode, length, times, size, check sum, letters of the compression
_SIZE = struct.Struct("<Q")
_INDEX_DTYPE = np.dtype([("opcode", "u1"), ("length", "<u8"), ("channel_id", "<u2"), ("size", "<u4")])


@dataclass(frozen=True, slots=True, kw_only=True)
class ChunkView:
    """The messages of one chunk.

    Attributes:
        data: The uncompressed chunk, shape (bytes,).
        offsets: Where each message record starts, by channel id, in the order of the file.
    """

    data: NDArray[np.uint8]
    offsets: Mapping[int, NDArray[np.int64]]

    def records(self, channel_id: int, size: int) -> NDArray[np.void] | None:
        """The message records of a channel, heads included, as `size` raw bytes each.

        None when one of them would reach beyond the chunk.
        """
        offsets = self.offsets[channel_id]
        room = len(self.data) - size + 1
        if len(offsets) and (int(offsets.max()) >= room or int(offsets.min()) < 0):
            return None
        # every window of one record's length, copied only where a record starts
        windows = np.ndarray((max(room, 0),), dtype=f"V{size}", buffer=self.data, strides=(1,))
        return windows[offsets]

    def payloads(self, channel_id: int) -> Iterator[bytes]:
        """The messages of a channel one by one."""
        for offset in self.offsets[channel_id].tolist():
            _, length, *_ = MESSAGE_HEAD.unpack_from(self.data.data, offset)
            end = offset + MESSAGE_HEAD.size - MESSAGE_HEAD_LENGTH + length
            yield self.data[offset + MESSAGE_HEAD.size : end].tobytes()


@dataclass(frozen=True, slots=True, kw_only=True)
class Container:
    """A rosbag2 directory whose file ends and indexes are sound.

    Attributes:
        path: The directory.
        information: What metadata.yaml says.
        files: The MCAP files with their summaries, in order.
        attachments: Attached documents by name.
    """

    path: Path
    information: Mapping[str, Any]
    files: tuple[tuple[Path, SummarySection], ...]
    attachments: Mapping[str, bytes]

    @property
    def topics(self) -> dict[str, str]:
        """Message type of each topic."""
        found: dict[str, str] = {}
        for _, summary in self.files:
            for channel in summary.channels.values():
                schema = summary.schemas.get(channel.schema_id)
                found[channel.topic] = schema.name if schema else ""
        return found

    @property
    def definitions(self) -> dict[str, Definition]:
        """What the channel of each topic says about its messages; where several say different things: unknown."""
        found: dict[str, Definition] = {}
        for _, summary in self.files:
            for channel in summary.channels.values():
                schema = summary.schemas.get(channel.schema_id)
                one = Definition(
                    type_name=schema.name if schema else "",
                    form=schema.encoding if schema else "",
                    text=schema.data.decode("utf-8", "replace") if schema else "",
                    encoding=channel.message_encoding,
                )
                before = found.setdefault(channel.topic, one)
                if before != one:
                    found[channel.topic] = Definition(type_name=one.type_name, encoding="several definitions")
        return found

    @property
    def promised(self) -> int:
        """Number of messages that the files' statistics promise."""
        return sum(one.statistics.message_count for _, one in self.files if one.statistics)

    @property
    def counts(self) -> dict[str, int]:
        """Number of messages of each topic."""
        found = dict.fromkeys(self.topics, 0)
        for _, summary in self.files:
            counts = summary.statistics.channel_message_counts if summary.statistics else {}
            for channel in summary.channels.values():
                found[channel.topic] += counts.get(channel.id, 0)
        return found

    def chunks(
        self, topics: Collection[str] | None = None, times_ns: tuple[int, int] | None = None
    ) -> Iterator[tuple[Mapping[int, Channel], ChunkView]]:
        """Chunks in the order of the files, with the channels of their file.

        Args:
            topics: Only chunks with messages on these topics, and of these only such messages; None: everything.
            times_ns: Only chunks that reach into this range of log times, both ends included [ns]; None: all.

        Raises:
            BagError: A chunk is damaged.
        """
        for file, summary in self.files:
            wanted = None
            if topics is not None:
                wanted = {one.id for one in summary.channels.values() if one.topic in topics}
            with readable(file), FileBytes(file) as source:
                for entry in summary.chunks.entries(times_ns):
                    indexes = entry.indexes(source)
                    if wanted is not None and entry.index_length:  # else its writer left the index out
                        indexes = indexes[[one in wanted for one in indexes["channel_id"].tolist()]]
                        if not len(indexes):
                            continue
                    yield summary.channels, _view(source, entry, indexes, wanted)


def open_container(path: Path | str) -> Container:
    """Open a bag: read metadata.yaml, summaries and attachments.

    Raises:
        BagError: Not a bag, not closed properly, or damaged.
    """
    path = Path(path)
    information = _information(path)
    if information.get("storage_identifier") != "mcap":
        raise BagError(f"{path}: storage is {information.get('storage_identifier')!r}, expected 'mcap'")
    files: list[tuple[Path, SummarySection]] = []
    attachments: dict[str, bytes] = {}
    for file in named_files(path, information):
        with readable(file), FileBytes(file) as source:
            summary = _summary(file, source)
            attachments |= dict(_attachment(source, start) for start in summary.attachments)
        files.append((file, summary))
    return Container(path=path, information=information, files=tuple(files), attachments=attachments)


def _summary(file: Path, source: FileBytes) -> SummarySection:
    summary = summary_of(source)
    if isinstance(summary, str):
        if "breaks off" in summary:
            raise BagError(
                f"{file}: {summary}; its complete chunks are intact: `dcmg bag repair {file.parent}` restores them"
            )
        raise BagError(f"{file}: damaged ({summary})")
    if summary.statistics is None or summary.statistics.chunk_count != len(summary.chunks):
        raise BagError(f"{file}: has no index of its chunks, expected an indexed MCAP file")
    return summary


def _attachment(source: FileBytes, start: int) -> tuple[str, bytes]:
    frame = read_frame(source, start, source.size)
    if frame is None or frame.opcode != Opcode.ATTACHMENT:
        raise McapError(f"the attachment at byte {start} is not sound")
    return frame.record.name, frame.record.data


@contextmanager
def readable(file: Path) -> Iterator[None]:
    """Turn whatever the MCAP and compression libraries make of a damaged file into one line.

    Raises:
        BagError: Instead of their errors.
    """
    try:
        yield
    except BagError:
        raise
    except FileNotFoundError:
        raise BagError(f"{file}: is missing, but {METADATA_FILE} names it") from None
    except Exception as error:  # mcap, zstandard and lz4 raise many kinds, among them plain RuntimeError
        raise BagError(f"{file}: damaged ({' '.join(str(error).split()) or type(error).__name__})") from error


def _information(path: Path) -> dict[str, Any]:
    if not path.is_dir():
        raise BagError(f"{path}: {'is a file' if path.exists() else 'does not exist'}, expected a bag's directory")
    file = path / METADATA_FILE
    if not file.is_file():
        if any(path.glob("*.mcap")):
            raise BagError(
                f"{path}: {METADATA_FILE} is missing, as when the recorder was killed before it closed the bag: "
                f"`dcmg bag repair {path}` restores it"
            )
        raise BagError(f"{path}: holds no {METADATA_FILE}, expected a rosbag2 directory")
    return read_metadata(path)


def _view(source: FileBytes, entry: ChunkEntry, indexes: NDArray[np.void], wanted: Collection[int] | None) -> ChunkView:
    raw = source.read(entry.start, entry.length + entry.index_length)
    opcode, length, _, _, _, crc, letters = _CHUNK_HEAD.unpack_from(raw)
    at = _CHUNK_HEAD.size + letters + _SIZE.size
    if opcode != Opcode.CHUNK or 9 + length != entry.length or len(raw) < entry.length or at > entry.length:
        raise McapError(f"no chunk of {entry.length} bytes at byte {entry.start}")
    try:
        content = expand(raw[_CHUNK_HEAD.size : at - _SIZE.size].decode(), raw[at : entry.length])
    except BagError as error:
        raise McapError(str(error)) from error  # `readable` names the file
    if crc and zlib.crc32(content) != crc:
        raise McapError("a chunk's check sum does not fit its content")
    data = np.frombuffer(content, dtype=np.uint8)
    if not entry.index_length:  # its writer left the index out
        return ChunkView(data=data, offsets=_walked(content, wanted))
    return ChunkView(data=data, offsets=_offsets(raw, entry, indexes))


def _offsets(raw: bytes, entry: ChunkEntry, indexes: NDArray[np.void]) -> dict[int, NDArray[np.int64]]:
    """Offsets by channel id out of the MessageIndex records that follow a chunk."""
    places = indexes["offset"] - entry.start
    if not len(places):
        return {}
    if int(places.min()) < entry.length or int(places.max()) > len(raw) - INDEX_HEAD.size:
        raise McapError("a message index is not where the summary says")
    windows = np.ndarray((len(raw) - INDEX_HEAD.size + 1,), dtype=f"V{INDEX_HEAD.size}", buffer=raw, strides=(1,))
    heads = windows[places].view(_INDEX_DTYPE)
    sizes, starts = heads["size"].astype(np.int64), places + INDEX_HEAD.size
    if (
        np.any(heads["opcode"] != Opcode.MESSAGE_INDEX)
        or np.any(heads["channel_id"] != indexes["channel_id"])
        or np.any(heads["length"] != 6 + sizes)
        or np.any(sizes % ENTRY_BYTES)
        or np.any(starts + sizes > len(raw))
    ):
        raise McapError("a message index is damaged")
    found = zip(heads["channel_id"].tolist(), starts.tolist(), (sizes // 8).tolist(), strict=True)
    return {
        channel_id: np.frombuffer(raw, dtype="<i8", count=count, offset=start)[1::2]
        for channel_id, start, count in found
    }


def _walked(content: bytes, wanted: Collection[int] | None) -> dict[int, NDArray[np.int64]]:
    """The same, from record to record."""
    table = walk(content)
    if not table.whole:
        raise McapError("a chunk holds something besides records")
    ids = {int(one) for one in np.unique(table.channel_ids)}
    return {one: table.starts[table.channel_ids == one] for one in ids if wanted is None or one in wanted}


def record_dtype(message: np.dtype[np.void]) -> np.dtype[np.void]:
    """A whole MCAP message record around the dtype of a Layout."""
    head = [("opcode", "u1"), ("length", "<u8"), ("channel_id", "<u2"), ("rest", "V20")]
    return np.dtype([*head, ("message", message)])
