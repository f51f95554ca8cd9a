"""A file as bytes at positions, of which only what is asked for is in memory."""

import re
import zlib
from pathlib import Path
from types import TracebackType
from typing import final

_PIECE = 1024 * 1024
_CHUNK_HEAD = 49  # opcode, length and fixed fields of a chunk without its compression name
# a chunk record shorter than 4 GiB whose compression has a name of ours
_CHUNK = re.compile(rb"(?=\x06.{4}\0{4}.{28}(?:\x04\0{3}zstd|\x03\0{3}lz4|\0{4}.{4}\0{4}))", re.DOTALL)


@final
class FileBytes:
    """A file opened for reading; a context manager."""

    def __init__(self, path: Path) -> None:
        """Open the file.

        Raises:
            OSError: It cannot be opened.
        """
        self._stream = path.open("rb")
        self.size = self._stream.seek(0, 2)

    def read(self, start: int, length: int) -> bytes:
        """The bytes from a position on, fewer at the end of the file."""
        if not 0 <= start < self.size or length <= 0:
            return b""
        self._stream.seek(start)
        return self._stream.read(min(length, self.size - start))

    def crc32(self, start: int, end: int) -> int:
        """Check sum of the bytes in between."""
        crc = 0
        for at in range(start, end, _PIECE):
            crc = zlib.crc32(self.read(at, min(_PIECE, end - at)), crc)
        return crc

    def find_chunk(self, start: int) -> int | None:
        """Next position at which something like the head of a chunk stands."""
        overlap = _CHUNK_HEAD + 8
        for at in range(start, self.size, _PIECE):
            found = _CHUNK.search(self.read(at, _PIECE + overlap))
            if found:
                return at + found.start()
        return None

    def __enter__(self) -> "FileBytes":
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
