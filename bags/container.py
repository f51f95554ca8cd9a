"""Reading a rosbag2 directory of MCAP files chunk by chunk, each channel's messages as one numpy array."""

import struct
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, final

import numpy as np
import yaml
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, ChunkIndex
from mcap.summary import Summary
from numpy.typing import NDArray

from bags.chunk import MESSAGE_HEAD, MESSAGE_HEAD_LENGTH
from bags.errors import BagError
from bags.expand import expand
from bags.metadata import METADATA_FILE, ROOT_KEY
from bags.yaml_text import load

_RECORD_HEAD = struct.Struct("<BQ")
_MESSAGE_INDEX_HEAD = struct.Struct("<HI")


@final
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


@final
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
    files: tuple[tuple[Path, Summary], ...]
    attachments: Mapping[str, bytes]

    @property
    def topics(self) -> dict[str, str]:
        """Message type of each topic."""
        found: dict[str, str] = {}
        for _, summary in self.files:
            for channel in summary.channels.values():
                found[channel.topic] = summary.schemas[channel.schema_id].name if channel.schema_id else ""
        return found

    @property
    def counts(self) -> dict[str, int]:
        """Number of messages of each topic."""
        found = dict.fromkeys(self.topics, 0)
        for _, summary in self.files:
            counts = summary.statistics.channel_message_counts if summary.statistics else {}
            for channel in summary.channels.values():
                found[channel.topic] += counts.get(channel.id, 0)
        return found

    def chunks(self) -> Iterator[tuple[Mapping[int, Channel], ChunkView]]:
        """Every chunk in the order of the files, with the channels of its file.

        Raises:
            BagError: A chunk is damaged.
        """
        for file, summary in self.files:
            with readable(file), file.open("rb") as stream:
                for index in sorted(summary.chunk_indexes, key=lambda one: one.chunk_start_offset):
                    stream.seek(index.chunk_start_offset)
                    yield summary.channels, _view(stream.read(index.chunk_length + index.message_index_length), index)


def open_container(path: Path) -> Container:
    """Open a bag: read metadata.yaml, summaries and attachments.

    Raises:
        BagError: Not a bag, not closed properly, or damaged.
    """
    information = _information(path)
    if information.get("storage_identifier") != "mcap":
        raise BagError(f"{path}: storage is {information.get('storage_identifier')!r}, expected 'mcap'")
    names = information.get("relative_file_paths")
    if not isinstance(names, list) or not names:
        raise BagError(f"{path / METADATA_FILE}: relative_file_paths = {names!r}, expected a list of MCAP files")
    files: list[tuple[Path, Summary]] = []
    attachments: dict[str, bytes] = {}
    for name in names:
        file = path / str(name)
        with readable(file), file.open("rb") as stream:
            reader = make_reader(stream)
            summary = reader.get_summary()
            if summary is None or summary.statistics is None:
                raise BagError(f"{file}: has no summary, expected an indexed MCAP file")
            attachments |= {one.name: one.data for one in reader.iter_attachments()}
        files.append((file, summary))
    return Container(path=path, information=information, files=tuple(files), attachments=attachments)


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
        if isinstance(error, McapError) and not _ends_properly(file):
            raise BagError(
                f"{file}: the file breaks off without an MCAP footer, as when its recorder was killed; its complete "
                f"chunks are intact: `dcmg bag repair {file.parent}` restores them"
            ) from error
        raise BagError(f"{file}: damaged ({' '.join(str(error).split()) or type(error).__name__})") from error


def _ends_properly(file: Path) -> bool:
    magic = b"\x89MCAP0\r\n"
    with file.open("rb") as stream:
        size = stream.seek(0, 2)
        stream.seek(max(size - len(magic), 0))
        return stream.read() == magic


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
    try:
        document = load(file.read_text("utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise BagError(f"{file}: cannot be read as YAML ({' '.join(str(error).split())})") from error
    information = document.get(ROOT_KEY) if isinstance(document, dict) else None
    if not isinstance(information, dict):
        raise BagError(f"{file}: has no {ROOT_KEY}, expected the metadata of rosbag2")
    return information


def _view(raw: bytes, index: ChunkIndex) -> ChunkView:
    stream = ReadDataStream(BytesIO(raw[_RECORD_HEAD.size : index.chunk_length]))
    chunk = Chunk.read(stream)
    try:
        content = expand(chunk.compression, chunk.data)
    except BagError as error:
        raise McapError(str(error)) from error  # `readable` names the file
    if chunk.uncompressed_crc and zlib.crc32(content) != chunk.uncompressed_crc:
        raise McapError("a chunk's check sum does not fit its content")
    data = np.frombuffer(content, dtype=np.uint8)
    return ChunkView(data=data, offsets=_offsets(memoryview(raw)[index.chunk_length :]))


def _offsets(indexes: memoryview) -> dict[int, NDArray[np.int64]]:
    """Offsets by channel id out of the MessageIndex records that follow a chunk."""
    found: dict[int, NDArray[np.int64]] = {}
    at = 0
    while at < len(indexes):
        opcode, length = _RECORD_HEAD.unpack_from(indexes, at)
        at += _RECORD_HEAD.size
        if opcode == Opcode.MESSAGE_INDEX:
            channel_id, size = _MESSAGE_INDEX_HEAD.unpack_from(indexes, at)
            start = at + _MESSAGE_INDEX_HEAD.size
            found[channel_id] = np.frombuffer(indexes[start : start + size], dtype="<i8")[1::2]
        at += length
    return found


def record_dtype(message: np.dtype[np.void]) -> np.dtype[np.void]:
    """A whole MCAP message record around the dtype of a Layout."""
    head = [("opcode", "u1"), ("length", "<u8"), ("channel_id", "<u2"), ("rest", "V20")]
    return np.dtype([*head, ("message", message)])
