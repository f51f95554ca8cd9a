"""The folder of a rosbag2 recording: what metadata.yaml says, and which files it names."""

from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from typing import Any

import yaml

from bags.mcap.errors import BagError
from bags.mcap.kinds import POINTERS, kind_of
from bags.mcap.metadata import METADATA_FILE, ROOT_KEY
from bags.mcap.yaml_text import load

_MOST_DIGITS = 18
_MOST_METADATA = 4_000_000


def by_number(file: Path) -> tuple[str, int, str]:
    """Key that puts `x_2.mcap` before `x_10.mcap`."""
    stem = file.name.partition(".")[0]
    head, _, digits = stem.rpartition("_")
    return (
        (head, int(digits), file.name) if digits.isdecimal() and len(digits) <= _MOST_DIGITS else (stem, -1, file.name)
    )


def read_metadata(path: Path) -> dict[str, Any]:
    """What metadata.yaml of a directory says.

    Raises:
        BagError: It cannot be read, or is no metadata of rosbag2.
    """
    file = path / METADATA_FILE
    kind = kind_of(file)
    if kind in POINTERS:
        raise BagError(f"{file}: is {kind.value}, expected the metadata of rosbag2")
    try:
        if file.stat().st_size > _MOST_METADATA:
            raise BagError(f"{file}: has {file.stat().st_size} bytes, expected at most {_MOST_METADATA}")
        document = load(file.read_text("utf-8"))
    except (OSError, ValueError, yaml.YAMLError) as error:
        raise BagError(f"{file}: cannot be read as YAML ({' '.join(str(error).split()):.200})") from error
    information = document.get(ROOT_KEY) if isinstance(document, dict) else None
    if not isinstance(information, dict):
        raise BagError(f"{file}: has no {ROOT_KEY}, expected the metadata of rosbag2")
    return information


def named_files(path: Path, information: Mapping[str, Any]) -> list[Path]:
    """The files that metadata.yaml names, each inside the directory.

    Raises:
        BagError: It names none, one outside, or one that is missing.
    """
    names = information.get("relative_file_paths")
    if not isinstance(names, list) or not names:
        raise BagError(f"{path / METADATA_FILE}: relative_file_paths = {names!r:.80}, expected a list of files")
    found = []
    for name in names:
        inside = PurePosixPath(str(name))
        # the first versions of rosbag2 wrote the directory's name too
        if inside.name != str(name) and inside.parts[:-1] != (path.resolve().name,):
            raise BagError(
                f"{path / METADATA_FILE}: relative_file_paths names {str(name)!r}, expected a file in the same folder"
            )
        candidates = [path / inside.name, path / f"{inside.name}.zstd", path / f"{inside.name}.zst"]
        file = next((one for one in candidates if one.exists()), None)
        if file is None:
            raise BagError(f"{candidates[0]}: is missing, but {METADATA_FILE} names it")
        found.append(file)
    return found
