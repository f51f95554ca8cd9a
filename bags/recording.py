"""What of a run is recorded, and into how many files."""

import re
from dataclasses import dataclass
from typing import final

from bags.errors import BagError


@final
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


@final
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
