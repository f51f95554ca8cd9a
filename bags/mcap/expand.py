"""Decompressing chunks without trusting what they say about their size."""

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from io import BytesIO
from typing import cast

import lz4.frame  # type: ignore[import-untyped] # lz4 ships no types
import zstandard

from bags.mcap.errors import BagError

MAX_CHUNK_BYTES = 64 * 1024 * 1024  # sixteen times the largest chunk of rosbag2's presets
_PIECE = 1024 * 1024


def expand(compression: str, data: bytes, limit: int = MAX_CHUNK_BYTES) -> bytes:
    """Decompress a chunk.

    Args:
        compression: MCAP's name: "", "lz4" or "zstd".
        data: The compressed bytes.
        limit: Memory bound: what expands to more is damaged, or not for us.

    Raises:
        BagError: Unknown compression, damaged, broken off, or more than the limit.
    """
    content, whole = expand_prefix(compression, data, limit)
    if not whole:
        raise BagError(f"compressed data ({compression or 'none'}) is damaged, breaks off or exceeds {limit} bytes")
    return content


def expand_prefix(compression: str, data: bytes, limit: int = MAX_CHUNK_BYTES) -> tuple[bytes, bool]:
    """Decompress as far as it goes.

    Args:
        compression: MCAP's name.
        data: The compressed bytes, possibly broken off.
        limit: Memory bound.

    Returns:
        The content, and whether it is whole.

    Raises:
        BagError: Unknown compression.
    """
    if compression == "":
        return data[:limit], len(data) <= limit
    if compression == "lz4":
        decompressor = lz4.frame.LZ4FrameDecompressor()
        feed = _lz4_pieces(decompressor, data)
        parts, sound = _gather(feed, limit)
        return parts, sound and bool(decompressor.eof)
    if compression == "zstd":
        known = _zstd_size(data)
        if known is not None and known <= limit:  # at once: several times as fast as piece by piece
            with suppress(zstandard.ZstdError):
                content = zstandard.ZstdDecompressor(max_window_size=limit).decompress(data)
                return content, len(content) == known
        stream = zstandard.ZstdDecompressor(max_window_size=limit).stream_reader(BytesIO(data))
        parts, sound = _gather(partial(stream.read, _PIECE), limit)
        # a stream that ends early looks like an end: only the frame's own size tells
        size = _zstd_size(data)
        return parts, sound and (size is None or size == len(parts))
    raise BagError(f"chunk compression {compression!r} is unknown, expected '', 'lz4' or 'zstd'")


def _lz4_pieces(decompressor: "lz4.frame.LZ4FrameDecompressor", data: bytes) -> Callable[[], bytes]:
    left = [data]

    def piece() -> bytes:
        if decompressor.eof:
            return b""
        given, left[0] = left[0], b""
        return cast("bytes", decompressor.decompress(given, max_length=_PIECE))

    return piece


def _gather(piece: Callable[[], bytes], limit: int) -> tuple[bytes, bool]:
    parts: list[bytes] = []
    total = 0
    try:
        while total <= limit:
            part = piece()
            if not part:
                return b"".join(parts), True
            parts.append(part)
            total += len(part)
    except Exception:  # noqa: BLE001 - both libraries raise several kinds, plain RuntimeError among them
        return b"".join(parts), False
    return b"", False


def _zstd_size(data: bytes) -> int | None:
    try:
        size = zstandard.frame_content_size(data)
    except zstandard.ZstdError:
        return None
    return size if size >= 0 else None
