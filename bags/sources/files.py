"""Which files a recording consists of, and what metadata.yaml says about them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bags.mcap.errors import BagError
from bags.mcap.folder import by_number, named_files, read_metadata
from bags.mcap.kinds import check_regular
from bags.mcap.metadata import METADATA_FILE

_SUFFIXES = (".mcap", ".db3", ".bag", ".mcap.zstd", ".db3.zstd", ".mcap.zst", ".db3.zst")


@dataclass(frozen=True, slots=True, kw_only=True)
class Listing:
    """The files of a recording in order, and what is said about them.

    Attributes:
        files: As they stand in the folder, compressed or not.
        types: Message type of each topic.
        stated: Number of messages of each topic.
        information: metadata.yaml, {} without one.
        notes: What a person should know.
    """

    files: tuple[Path, ...]
    types: Mapping[str, str] = field(default_factory=dict)
    stated: Mapping[str, int] = field(default_factory=dict)
    information: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def list_files(path: Path) -> Listing:
    """The files of a recording.

    Args:
        path: One file, or a directory with or without metadata.yaml.

    Raises:
        BagError: There are none, metadata.yaml cannot be read, or names what is not there.
    """
    if not path.exists():
        raise BagError(f"{path}: no such file or folder, expected a bag or a table")
    if not path.is_dir():
        check_regular(path)
        return Listing(files=(path,))
    there = sorted((one for one in path.iterdir() if one.name.endswith(_SUFFIXES)), key=by_number)
    if not (path / METADATA_FILE).exists():
        if not there:
            raise BagError(f"{path}: holds no {METADATA_FILE} and no .mcap, .db3 or .bag file, expected a recording")
        names = ", ".join(one.name for one in there)
        return Listing(files=tuple(there), notes=(f"{METADATA_FILE} is missing: {names:.200} read as they are",))
    information = read_metadata(path)
    files = named_files(path, information)
    unnamed = [one.name for one in there if one not in files and one.with_suffix("") not in files]
    notes = (f"{', '.join(unnamed):.200}: not read, {METADATA_FILE} does not name it",) if unnamed else ()
    types, stated = _topics(information)
    return Listing(files=tuple(files), types=types, stated=stated, information=information, notes=notes)


def _topics(information: Mapping[str, Any]) -> tuple[dict[str, str], dict[str, int]]:
    """Types and counts by topic, as far as they can be understood."""
    types: dict[str, str] = {}
    stated: dict[str, int] = {}
    entries = information.get("topics_with_message_count")
    for one in entries if isinstance(entries, list) else ():
        about = one.get("topic_metadata") if isinstance(one, dict) else None
        if isinstance(about, dict) and isinstance(about.get("name"), str):
            name, count = about["name"], one.get("message_count")
            types[name] = str(about.get("type", ""))
            stated[name] = stated.get(name, 0) + (count if isinstance(count, int) else 0)
    return types, stated
