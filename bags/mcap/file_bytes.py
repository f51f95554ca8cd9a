"""A file as bytes at positions, of which only what is asked for is in memory."""

import re
import zlib
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Self

_PIECE = 1024 * 1024
_CHUNK_HEAD = 49  # opcode, length and fixed fields of a chunk without its compression name
# a chunk record shorter than 4 GiB whose compression has a name of ours
_CHUNK = re.compile(rb"(?=\x06.{4}\0{4}.{28}(?:\x04\0{3}zstd|\x03\0{3}lz4|\0{4}.{4}\0{4}))", re.DOTALL)


class FileBytes:
    """A file opened for reading; a context manager."""

    def __init__(self, path: Path, base: int = 0) -> None:
        """Open the file.

        Args:
            path: The file.
            base: Bytes in front that do not count.

        Raises:
            OSError: It cannot be opened.
        """
        self._stream = path.open("rb")
        self._base = base
        self.size = max(self._stream.seek(0, 2) - base, 0)

    def read(self, start: int, length: int) -> bytes:
        """The bytes from a position on, fewer at the end of the file."""
        if not 0 <= start < self.size or length <= 0:
            return b""
        self._stream.seek(self._base + start)
        return self._stream.read(min(length, self.size - start))

    def crc32(self, start: int, end: int) -> int:
        """Check sum of the bytes in between."""
        crc = 0
        for at in range(start, end, _PIECE):
            crc = zlib.crc32(self.read(at, min(_PIECE, end - at)), crc)
        return crc

    def find(self, what: bytes, limit: int) -> int | None:
        """First position before a limit at which some bytes stand."""
        for at in range(0, min(limit, self.size), _PIECE):
            found = self.read(at, _PIECE + len(what)).find(what)
            if found >= 0:
                return at + found
        return None

    def find_chunks(self, start: int) -> Iterator[int]:
        """Positions at which something like the head of a chunk stands, each byte looked at once."""
        overlap = _CHUNK_HEAD + 8
        for at in range(start, self.size, _PIECE):
            for found in _CHUNK.finditer(self.read(at, _PIECE + overlap)):
                if found.start() < _PIECE:
                    yield at + found.start()

    def __enter__(self) -> Self:
        """Return self."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the file."""
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._stream.close()
