"""The options `--bag-…` of every command that records: how the bag is written."""

from __future__ import annotations

from enum import Enum
from math import isfinite
from typing import Annotated

import typer

from bags.mcap.packing import Compression
from bags.mcap.recording import Buffer, ChunkPreset, Recording, Split, TopicFilter, WhenFull
from dcmg.errors import CommandError

_MEGABYTE = 1_000_000
_PANEL = "Recording"


class CompressionName(Enum):
    """Names of the compressions on the command line."""

    NONE = "none"
    LZ4 = "lz4"
    ZSTD = "zstd"


BagCompression = Annotated[
    CompressionName, typer.Option("--bag-compression", help="of the bag's chunks", rich_help_panel=_PANEL)
]
BagChunks = Annotated[
    ChunkPreset,
    typer.Option(
        "--bag-chunks",
        help="safe: 64 KiB or 0.05 s, which is what a killed recorder loses; balanced: 256 KiB or 0.25 s; "
        "compact: 1 MiB or 0.5 s, smaller files, quicker reading",
        rich_help_panel=_PANEL,
    ),
]
BagSplitMb = Annotated[
    float | None,
    typer.Option(
        "--bag-split-mb",
        metavar="MB",
        help="go on in another file of the bag beyond this size",
        show_default=False,
        rich_help_panel=_PANEL,
    ),
]
BagSplitSec = Annotated[
    float | None,
    typer.Option(
        "--bag-split-sec",
        metavar="SECONDS",
        help="go on in another file of the bag after this much simulated time",
        show_default=False,
        rich_help_panel=_PANEL,
    ),
]
BagTopics = Annotated[
    list[str] | None,
    typer.Option(
        "--bag-topics",
        metavar="REGEX",
        help="record only topics whose whole name matches, as in `/dgu_1/.*`; repeatable; without some per-step topics "
        "there is no report",
        show_default=False,
        rich_help_panel=_PANEL,
    ),
]
BagExclude = Annotated[
    list[str] | None,
    typer.Option(
        "--bag-exclude",
        metavar="REGEX",
        help="do not record topics whose whole name matches; repeatable",
        show_default=False,
        rich_help_panel=_PANEL,
    ),
]
BagBufferMb = Annotated[
    float,
    typer.Option("--bag-buffer-mb", metavar="MB", help="how much may wait for a slow disk", rich_help_panel=_PANEL),
]
BagWhenFull = Annotated[
    WhenFull | None,
    typer.Option(
        "--bag-when-full",
        help="when that much waits: the run waits too, or whole steps are left out, counted and reported; "
        "default: wait in lockstep, drop in real time",
        show_default=False,
        rich_help_panel=_PANEL,
    ),
]


def recording_of(
    *,
    compression: CompressionName,
    chunks: ChunkPreset,
    split_mb: float | None,
    split_sec: float | None,
    topics: list[str] | None,
    exclude: list[str] | None,
    buffer_mb: float = 32.0,
    when_full: WhenFull | None = None,
    in_time: WhenFull = WhenFull.WAIT,
) -> Recording:
    """What the options mean; `in_time` is what a full buffer does where nobody said it.

    Raises:
        BagError: a limit that no file can keep, or a pattern that is none.
        CommandError: a size or time that is no positive number.
    """
    for option, value in (("split-mb", split_mb), ("split-sec", split_sec), ("buffer-mb", buffer_mb)):
        if value is not None and not (isfinite(value) and value > 0.0):
            raise CommandError(f"--bag-{option} {value:g}: expected a positive number")
    return Recording(
        compression=Compression[compression.name],
        chunks=chunks,
        split=Split(
            max_bytes=None if split_mb is None else round(split_mb * _MEGABYTE),
            max_duration_sec=split_sec,
        ),
        topics=TopicFilter(include=tuple(topics or (".*",)), exclude=tuple(exclude or ())),
        buffer=Buffer(max_bytes=round(buffer_mb * _MEGABYTE), when_full=when_full or in_time),
    )
