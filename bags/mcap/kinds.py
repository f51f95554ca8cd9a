"""What a file is, by its first bytes: names say little, and some files only stand for others."""

import stat
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from typing import Final

from bags.mcap.errors import BagError
from bags.mcap.frames import MAGIC

ZSTD_MAGIC: Final = b"\x28\xb5\x2f\xfd"


class Kind(Enum):
    """What a file holds."""

    MCAP = "an MCAP file"
    SQLITE = "a sqlite3 file of rosbag2"
    ROS1 = "a ROS 1 bag"
    ZSTD = "a file compressed with zstd"
    LFS = "a Git LFS pointer, not the recording itself: `git lfs pull` fetches it"
    ANNEX = "a git-annex pointer, not the recording itself: `git annex get` fetches it"
    EMPTY = "an empty file"
    OTHER = "no recording that is known here"


_MAGICS: Mapping[bytes, Kind] = {
    MAGIC: Kind.MCAP,
    b"SQLite format 3\0": Kind.SQLITE,
    b"#ROSBAG V": Kind.ROS1,
    ZSTD_MAGIC: Kind.ZSTD,
    b"version https://git-lfs": Kind.LFS,
    b"/annex/objects/": Kind.ANNEX,
}
POINTERS: Final = (Kind.LFS, Kind.ANNEX, Kind.EMPTY)
# sound, but of another kind than check and repair know: what does for them what those do for MCAP
ELSEWHERE: Final[Mapping[Kind, str]] = {
    Kind.SQLITE: "`dcmg bag info` counts what is in it, `sqlite3 FILE 'PRAGMA integrity_check'` checks it",
    Kind.ROS1: "`dcmg bag info` reads it, `rosbag reindex` repairs it",
}


def kind_of(file: Path) -> Kind:
    """What a file holds.

    Raises:
        BagError: It cannot be read, or is a pipe or the like, which would be waited for.
    """
    check_regular(file)
    try:
        with file.open("rb") as stream:
            start = stream.read(64)
    except OSError as error:
        raise BagError(f"{file}: cannot be read ({error.strerror or error})") from error
    if not start:
        return Kind.EMPTY
    return next((kind for magic, kind in _MAGICS.items() if start.startswith(magic)), Kind.OTHER)


def check_regular(file: Path) -> None:
    """Refuse what is no regular file: reading a pipe waits for whoever writes into it.

    Raises:
        BagError: It is missing or of another kind.
    """
    try:
        mode = file.stat().st_mode
    except OSError as error:
        raise BagError(f"{file}: cannot be read ({error.strerror or error})") from error
    if not stat.S_ISREG(mode):
        raise BagError(f"{file}: is no regular file, expected a recording")
