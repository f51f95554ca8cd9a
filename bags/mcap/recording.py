"""How a run is recorded: which topics, in what chunks, into how many files, and what if the disk is slow."""

import re
from dataclasses import dataclass, field
from enum import Enum
from typing import Final

from bags.mcap.errors import BagError
from bags.mcap.packing import Compression


class ChunkPreset(Enum):
    """Sizes of chunks by name; what they are is in CHUNK_PRESETS."""

    SAFE = "safe"
    BALANCED = "balanced"
    COMPACT = "compact"


@dataclass(frozen=True, slots=True, kw_only=True)
class Chunks:
    """When a chunk is closed and goes to the disk.

    Attributes:
        max_bytes: Once it holds this much, before compression.
        max_age_sec: With the first message that comes this long (wall time) after its first one [s].
    """

    max_bytes: int
    max_age_sec: float


# the age is what a kill costs; a full chunk keeps the disk, and who else uses the interpreter, busy for milliseconds
CHUNK_PRESETS: Final = {
    ChunkPreset.SAFE: Chunks(max_bytes=64 * 1024, max_age_sec=0.05),
    ChunkPreset.BALANCED: Chunks(max_bytes=256 * 1024, max_age_sec=0.25),
    ChunkPreset.COMPACT: Chunks(max_bytes=1024 * 1024, max_age_sec=0.5),
}


class WhenFull(Enum):
    """What happens when the disk is slower than the run for so long that the buffer is full."""

    WAIT = "wait"  # the run waits for the disk: nothing is lost
    DROP = "drop"  # whole steps are left out, counted and reported: the run is never held up


@dataclass(frozen=True, slots=True, kw_only=True)
class Buffer:
    """What may wait for the disk in memory.

    Attributes:
        max_bytes: Bytes of closed chunks, compressed.
        when_full: What happens beyond.
    """

    max_bytes: int = 32_000_000
    when_full: WhenFull = WhenFull.WAIT

    def __post_init__(self) -> None:
        """Raise BagError for a buffer that holds nothing."""
        if self.max_bytes <= 0:
            raise BagError(f"max_bytes of the buffer is {self.max_bytes}, expected a positive number")


@dataclass(frozen=True, slots=True, kw_only=True)
class Split:
    """When a bag goes on in another file; looked at whenever a chunk is closed, so a file may exceed it by a chunk.

    Attributes:
        max_bytes: Size of a file, None: any.
        max_duration_sec: Span of its stamps [s], None: any.
    """

    max_bytes: int | None = None
    max_duration_sec: float | None = None

    def __post_init__(self) -> None:
        """Raise BagError for limits that no file can keep."""
        for name in ("max_bytes", "max_duration_sec"):
            limit = getattr(self, name)
            if limit is not None and not limit > 0:
                raise BagError(f"{name} is {limit}, expected a positive number")

    def due(self, size: int, start_ns: int, next_ns: int) -> bool:
        """Whether a chunk goes into a new file.

        Args:
            size: Bytes in the file so far.
            start_ns: Its earliest stamp [ns].
            next_ns: Latest stamp of the chunk [ns].
        """
        if self.max_bytes is not None and size >= self.max_bytes:
            return True
        return self.max_duration_sec is not None and (next_ns - start_ns) * 1e-9 >= self.max_duration_sec


@dataclass(frozen=True, slots=True, kw_only=True)
class TopicFilter:
    """Which topics are recorded: those that match one of `include` and none of `exclude`.

    Attributes:
        include: Regular expressions for whole topic names.
        exclude: Likewise.
    """

    include: tuple[str, ...] = (".*",)
    exclude: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Raise BagError for what is no regular expression."""
        for pattern in (*self.include, *self.exclude):
            try:
                re.compile(pattern)
            except re.error as error:
                raise BagError(f"topic filter {pattern!r}: {error}, expected a regular expression") from error

    def accepts(self, topic: str) -> bool:
        """Whether a topic is recorded."""
        wanted = any(re.fullmatch(pattern, topic) for pattern in self.include)
        return wanted and not any(re.fullmatch(pattern, topic) for pattern in self.exclude)


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """Everything that can be chosen about a recording.

    Attributes:
        compression: Of the chunks.
        chunks: Their size.
        split: When to go on in another file.
        topics: What is recorded.
        buffer: What may wait for the disk.
    """

    compression: Compression = Compression.ZSTD
    chunks: ChunkPreset = ChunkPreset.SAFE
    split: Split = field(default_factory=Split)
    topics: TopicFilter = field(default_factory=TopicFilter)
    buffer: Buffer = field(default_factory=Buffer)
