"""Files that were compressed as a whole, as copies that can be read."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import zstandard

from bags.mcap.errors import BagError
from bags.mcap.kinds import Kind, kind_of

_PIECE = 1024 * 1024
_EXPANSION = 100  # a file that grows more than this is a bomb; recordings grow three- to tenfold
_ALWAYS = 1_000_000_000  # bytes that every file may grow to
_HEAD = 18  # bytes in which a frame of zstd says how large its content is


@contextmanager
def plain_file(file: Path) -> Iterator[Path]:
    """The file, or its decompressed copy for as long as the context lasts.

    Raises:
        BagError: It cannot be decompressed, breaks off, or grows beyond reason.
    """
    if kind_of(file) is not Kind.ZSTD:
        yield file
        return
    with TemporaryDirectory(prefix="dcmg_") as folder:
        there = Path(folder) / plain_name(file.name)
        _decompress(file, there)
        yield there


def plain_name(name: str) -> str:
    """The name that a file had before it was compressed."""
    return name.removesuffix(".zstd").removesuffix(".zst")


def _decompress(file: Path, there: Path) -> None:
    limit = max(_ALWAYS, _EXPANSION * file.stat().st_size)
    written = 0
    try:
        with (
            file.open("rb") as packed,
            there.open("wb") as out,
            zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True) as stream,
        ):
            stated = zstandard.frame_content_size(packed.read(_HEAD))
            packed.seek(0)
            while piece := stream.read(_PIECE):
                written += len(piece)
                if written > limit:
                    raise BagError(f"{file}: decompresses to more than {limit} bytes, expected fewer")
                out.write(piece)
    except (OSError, zstandard.ZstdError) as error:
        raise BagError(f"{file}: cannot be decompressed ({' '.join(str(error).split())})") from error
    if written < stated or not written:
        raise BagError(f"{file}: breaks off, or is empty: {written} bytes can be decompressed")
