"""What of a bag is intact: every check sum verified, everything that is said twice compared."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from mcap.opcode import Opcode

from bags.mcap.chunk import MESSAGE_HEAD
from bags.mcap.errors import BagError
from bags.mcap.file_bytes import FileBytes
from bags.mcap.folder import by_number, read_metadata
from bags.mcap.frames import MAGIC, Frame, parse_definition
from bags.mcap.kinds import ELSEWHERE, POINTERS, ZSTD_MAGIC, Kind, kind_of
from bags.mcap.mcap_file import OURS
from bags.mcap.metadata import METADATA_FILE, ROOT_KEY, whole_document
from bags.mcap.scan import Fault, Messages, survey
from bags.mcap.summary_section import NO_SUMMARY, SummarySection, summary_of
from bags.mcap.unpacked import plain_file, plain_name

_SUFFIXES = (".mcap", ".db3", ".bag")
_MOST_JUNK = 16_000_000  # bytes in front of a file
_MOST_FAULTS = 20  # of one file: a report is for people


@dataclass(frozen=True, slots=True, kw_only=True)
class Damage:
    """One thing in a bag that is not as it must be.

    Attributes:
        file: Name of the file.
        offset: Where in the file, None for the file as a whole.
        what: In words.
    """

    file: str
    offset: int | None
    what: str

    def __str__(self) -> str:
        """One line."""
        return f"{self.file}{'' if self.offset is None else f' at byte {self.offset}'}: {self.what}"


@dataclass(frozen=True, slots=True, kw_only=True)
class FileCheck:
    """What of one file is intact.

    Attributes:
        name: Name of the file.
        size: Bytes.
        chunks: Complete chunks whose check sums agree.
        messages: Messages in them, by topic.
        start_ns: Earliest stamp of these messages [ns], 0 without any.
        end_ns: Latest stamp [ns].
        attachments: Intact attachments by name.
    """

    name: str
    size: int
    chunks: int
    messages: Mapping[str, int]
    start_ns: int
    end_ns: int
    attachments: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckReport:
    """What of a bag is intact, and what is not.

    Attributes:
        path: The bag.
        files: What is intact, file by file.
        damages: What is not; empty: the bag is clean.
    """

    path: Path
    files: tuple[FileCheck, ...]
    damages: tuple[Damage, ...]

    @property
    def clean(self) -> bool:
        """Whether nothing is wrong."""
        return not self.damages

    @property
    def messages(self) -> int:
        """Number of intact messages."""
        return sum(sum(one.messages.values()) for one in self.files)

    def document(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "bag": str(self.path),
            "clean": self.clean,
            "messages": self.messages,
            "files": [asdict(one) for one in self.files],
            "damages": [asdict(one) for one in self.damages],
        }


def check(path: Path | str) -> CheckReport:
    """Go through a bag, or one MCAP file, from its first byte to its last.

    Args:
        path: The bag's directory or an MCAP file; it need not be closed, or whole.

    Raises:
        BagError: There is nothing to check.
    """
    path, damages = Path(path), list[Damage]()
    checks = []
    for file in mcap_files(path):
        with opened(file) as plain:
            checks.append(_File(plain, file.name).run(damages))
    if path.is_dir():
        damages += [Damage(file=METADATA_FILE, offset=None, what=what) for what in _metadata_faults(path, checks)]
    return CheckReport(path=path, files=tuple(one.result() for one in checks), damages=tuple(damages))


def mcap_files(path: Path | str) -> list[Path]:
    """The MCAP files of a bag in order of time, whether or not metadata.yaml can tell them.

    Raises:
        BagError: There is none.
    """
    path = Path(path)
    if not path.exists():
        raise BagError(f"{path}: does not exist, expected a bag's directory")
    if not path.is_dir():
        _check_kind(path, path)
        return [path]
    files = sorted((one for one in path.iterdir() if plain_name(one.name).endswith(_SUFFIXES)), key=by_number)
    there: dict[str, Path] = {}
    for file in files:
        if plain_name(file.name).endswith(".mcap"):
            there.setdefault(plain_name(file.name), file)  # the one that is not compressed comes first
    for file in there.values():
        if kind_of(file) is not Kind.EMPTY or len(there) == 1:  # a recorder that was killed behind a split leaves one
            _check_kind(file, file)
    if not there:
        for file in files:
            with opened(file):
                pass
        raise BagError(f"{path}: holds no *.mcap file, expected a rosbag2 directory")
    named = [there.pop(name) for name in _told_files(path, read_information(path)) if name in there]
    return [*named, *there.values()]


@contextmanager
def opened(file: Path) -> Iterator[Path]:
    """An MCAP file, or its decompressed copy for as long as the context lasts.

    Raises:
        BagError: It cannot be decompressed, or holds something else.
    """
    with plain_file(file) as plain:
        if kind_of(plain) is not Kind.EMPTY:
            _check_kind(plain, file)
        yield plain


def _told_files(path: Path, information: Mapping[str, Any]) -> list[str]:
    """The files that metadata.yaml names, as they were called before they were compressed."""
    told = information.get("relative_file_paths")
    prefix = f"{path.resolve().name}/"  # the first versions of rosbag2 wrote it too
    return [plain_name(str(one).removeprefix(prefix)) for one in told] if isinstance(told, list) else []


def read_information(path: Path | str) -> dict[str, Any]:
    """What metadata.yaml says, {} when it is missing or damaged."""
    path = Path(path)
    try:
        return read_metadata(path)
    except BagError:
        return {}


def _check_kind(file: Path, named: Path) -> None:
    """Refuse what is sound, but of another kind, and what only stands for a recording.

    Args:
        file: The file, or its decompressed copy.
        named: What to call it.

    Raises:
        BagError: It is.
    """
    kind = kind_of(file)
    if kind in (*POINTERS, *ELSEWHERE):
        advice = f": {ELSEWHERE[kind]}" if kind in ELSEWHERE else ""
        raise BagError(f"{named}: is {kind.value}, expected an MCAP file{advice}")


def start_of(file: Path) -> int:
    """How many bytes stand in front of an MCAP file, as when two files were joined; 0 when its start is lost."""
    with FileBytes(file) as source:
        # a head record follows the magic number: it stands at the end of the file too
        return source.find(MAGIC + bytes([Opcode.HEADER]), _MOST_JUNK) or 0


@dataclass(slots=True)
class _File:
    """One file while it is gone through."""

    file: Path
    name: str  # before it was decompressed
    size: int = 0
    chunks: int = 0
    counts: dict[int, int] = field(default_factory=dict)
    start_ns: int = 2**64
    end_ns: int = 0
    channels: dict[int, Any] = field(default_factory=dict)
    schemas: dict[int, Any] = field(default_factory=dict)
    attachments: list[str] = field(default_factory=list)
    library: str = ""
    metadata_text: str = ""
    ended: bool = False
    compressed: bool = False  # whether messages are, each by itself
    faults: list[Fault] = field(default_factory=list)

    def run(self, damages: list[Damage]) -> "_File":
        """Go through the file and append what is wrong."""
        base = start_of(self.file)
        if base:
            self.faults.append(Fault(start=0, what=f"{base} bytes stand in front of the file"))
        with FileBytes(self.file, base) as source:
            self.size = source.size
            found = summary_of(source)
            summary = found if isinstance(found, SummarySection) else None
            if source.read(0, len(MAGIC)) != MAGIC:
                self.faults.append(Fault(start=0, what=f"starts with {source.read(0, 8)!r}, expected {MAGIC!r}"))
            place = len(self.faults)
            for one in survey(source, summary):
                self._take(source, one, summary)
            # a summary may be missing: others leave it out, we do not
            if summary is None and not (found == NO_SUMMARY and self.ended and not self.library.startswith(OURS)):
                self.faults.insert(place, Fault(start=self.size, what=str(found)))
            self._compare(summary)
        damages += [Damage(file=self.name, offset=one.start, what=one.what) for one in self.faults[:_MOST_FAULTS]]
        if len(self.faults) > _MOST_FAULTS:
            more = f"{len(self.faults) - _MOST_FAULTS} further damages"
            damages.append(Damage(file=self.name, offset=None, what=more))
        return self

    def result(self) -> FileCheck:
        """What is intact."""
        messages: dict[str, int] = {}
        for channel_id, count in self.counts.items():
            channel = self.channels.get(channel_id)
            name = channel.topic if channel else f"(channel {channel_id} without a name)"
            messages[name] = messages.get(name, 0) + count
        return FileCheck(
            name=self.name,
            size=self.size,
            chunks=self.chunks,
            messages=messages,
            start_ns=self.start_ns if messages else 0,
            end_ns=self.end_ns,
            attachments=tuple(self.attachments),
        )

    def _take(self, source: FileBytes, found: Frame | Messages | Fault, summary: SummarySection | None) -> None:
        match found:
            case Fault():
                self.faults.append(found)
            case Messages():
                self._take_chunk(found, summary)
            case Frame():
                self._take_frame(source, found)

    def _take_frame(self, source: FileBytes, found: Frame) -> None:
        match found:
            case Frame(opcode=Opcode.HEADER):
                self.library = found.record.library
            case Frame(opcode=Opcode.CHANNEL):
                self.channels[found.record.id] = found.record
            case Frame(opcode=Opcode.SCHEMA):
                self.schemas[found.record.id] = found.record
            case Frame(opcode=Opcode.ATTACHMENT):
                self.attachments.append(found.record.name)
            case Frame(opcode=Opcode.METADATA) if found.record.name == "rosbag2":
                self.metadata_text = found.record.metadata.get("serialized_metadata", "")
            case Frame(opcode=Opcode.MESSAGE):
                channel_id = int.from_bytes(found.record[:2], "little")
                self.counts[channel_id] = self.counts.get(channel_id, 0) + 1
            case Frame(opcode=Opcode.DATA_END):
                self.ended = True
                promised = found.record.data_section_crc
                crc = source.crc32(0, found.start) if promised else 0
                if crc != promised or (not promised and self.library.startswith(OURS)):
                    what = f"the data's check sum is {crc:08x}, its end promises {promised:08x}"
                    self.faults.append(Fault(start=found.start, what=what))
            case _:
                pass

    def _take_chunk(self, found: Messages, summary: SummarySection | None) -> None:
        chunk, table = found.chunk, found.table
        self.chunks += 1
        values, numbers = np.unique(table.channel_ids, return_counts=True)
        for channel_id, number in zip(values.tolist(), numbers.tolist(), strict=True):
            self.counts[channel_id] = self.counts.get(channel_id, 0) + number
        start_ns, end_ns = (int(table.log_times.min()), int(table.log_times.max())) if len(table) else (0, 0)
        if len(table):
            self.start_ns, self.end_ns = min(self.start_ns, start_ns), max(self.end_ns, end_ns)
        length = chunk.end - chunk.start - 9
        if chunk.fields != (Opcode.CHUNK, length, start_ns, end_ns, len(chunk.content)):
            self._fault(chunk.start, "the head of the chunk does not fit its content")
        if not table.whole:
            self._fault(chunk.start, "the chunk holds something besides records")
        if not found.indexed:
            self._fault(chunk.end, "the message index does not fit the chunk before it")
        index = summary.chunks.at(chunk.start) if summary else None
        if index is not None and (index.length, index.start_ns, index.end_ns) != (
            chunk.end - chunk.start,
            start_ns,
            end_ns,
        ):
            self._fault(chunk.start, "the summary's index does not fit the chunk")
        if len(table) and not self.compressed:
            at = int(table.starts[0]) + MESSAGE_HEAD.size
            self.compressed = chunk.content[at : at + len(ZSTD_MAGIC)] == ZSTD_MAGIC
        for opcode, start, end in table.definitions:
            record = parse_definition(opcode, chunk.content[start:end])
            if record is not None:
                (self.channels if opcode == Opcode.CHANNEL else self.schemas)[record.id] = record

    def _fault(self, start: int, what: str) -> None:
        self.faults.append(Fault(start=start, what=what))

    def _differ(self, summary: Mapping[int, Any], data: Mapping[int, Any], used: Mapping[int, int]) -> bool:
        """Whether two sets of definitions differ; rosbag2 puts those without messages into the summary only.

        Args:
            summary: By id.
            data: By id.
            used: Those that have messages.
        """
        if self.library.startswith(OURS):
            return dict(summary) != dict(data)
        if any(number not in data for number in used):
            return True
        return any(summary.get(number) != one for number, one in data.items())

    def _compare(self, summary: SummarySection | None) -> None:
        """Hold the summary against what was found."""
        if summary is None:
            return
        if not self.ended:
            self._fault(summary.start, "no end of the data section before the summary")
        if not summary.checked and self.library.startswith(OURS):
            self._fault(self.size, "the summary has no check sum")
        if summary.channels and self._differ(summary.channels, self.channels, self.counts):
            self._fault(summary.start, "the channels in the summary differ from those in the data")
        used = {
            one.schema_id: 1 for number, one in summary.channels.items() if one.schema_id and self.counts.get(number)
        }
        if summary.schemas and self._differ(summary.schemas, self.schemas, used):
            self._fault(summary.start, "the schemas in the summary differ from those in the data")
        if summary.statistics is not None:
            promised = {key: count for key, count in summary.statistics.channel_message_counts.items() if count}
            if promised != self.counts or summary.statistics.chunk_count != self.chunks:
                self._fault(
                    summary.start,
                    f"{sum(self.counts.values())} messages in {self.chunks} chunks are intact, the statistics promise "
                    f"{summary.statistics.message_count} in {summary.statistics.chunk_count}",
                )


def _metadata_faults(path: Path, files: list[_File]) -> list[str]:
    file = path / METADATA_FILE
    if not file.is_file():
        return ["is missing, as when the recorder was killed before it closed the bag"]
    try:
        information = read_metadata(path)
    except BagError as error:
        return [str(error).removeprefix(f"{file}: ")]
    if not information:
        return [f"says nothing in {ROOT_KEY}"]
    faults = []
    if _told_files(path, information) != [one.file.name for one in files]:
        told = information.get("relative_file_paths")
        faults.append(f"names the files {told}, found {[one.name for one in files]}")
    count = sum(sum(one.counts.values()) for one in files)
    if information.get("message_count") != count:
        faults.append(f"promises {information.get('message_count')} messages, {count} are intact")
    mode = str(information.get("compression_mode") or "").lower()
    if any(one.compressed for one in files) != (mode == "message") and count:
        faults.append(f"says compression_mode {mode!r}, which does not fit the messages")
    faults += _entry_faults(information, files)
    last = files[-1]
    if (
        last.library.startswith(OURS)
        and last.metadata_text
        and (len(files) == 1 or f"- {files[0].file.name}\n" in last.metadata_text)  # else it is about one file only
        and file.read_bytes().decode("utf-8", "replace") != (whole_document(last.metadata_text))
    ):
        faults.append("differs from its copy in the last file")
    return faults


def _entry_faults(information: Mapping[str, Any], files: list[_File]) -> list[str]:
    """What metadata.yaml says about each file, held against the file."""
    entries = information.get("files")
    told = (
        {plain_name(str(one.get("path"))): one for one in entries if isinstance(one, dict)}
        if isinstance(entries, list)
        else {}
    )
    faults = []
    for one in files:
        entry = told.get(one.file.name)
        if entry is None:
            continue
        count, there = entry.get("message_count"), sum(one.counts.values())
        if count != there:
            faults.append(f"promises {count} messages in {one.file.name}, {there} are intact")
            continue
        since = entry.get("starting_time")
        start_ns = since.get("nanoseconds_since_epoch") if isinstance(since, dict) else None
        elsewhere = any(other.start_ns == start_ns for other in files if other is not one)
        # of others only a start that is another file's: what exactly they call the start differs between versions
        if there and start_ns != one.start_ns and (elsewhere or one.library.startswith(OURS)):
            faults.append(f"lets {one.file.name} begin at {start_ns} ns, it begins at {one.start_ns} ns")
    return faults
