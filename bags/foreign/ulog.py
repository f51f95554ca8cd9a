"""PX4 flight logs (ULog), through the `pyulog` library: `/topic.field`, `/topic_1.field` for the second instance."""

import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bags.foreign.columns import library
from bags.foreign.fields import FieldPath
from bags.foreign.track import Recording
from bags.mcap.errors import BagError
from bags.mcap.kinds import POINTERS, kind_of

_STAMP = "timestamp"
_MICROSECOND_NS = 1000
_HEAD = 16  # magic, version and start
_RECORD = struct.Struct("<HB")  # length and kind of a message


def is_ulog(source: Path) -> bool:
    """Whether the name of a file says that it is a ULog."""
    return not source.is_dir() and source.suffix.lower() in {".ulg", ".ulog"}


def ulog_topics(source: Path) -> tuple[dict[str, Any], tuple[str, ...]]:
    """The arrays of every topic by field, and what a person should know.

    Raises:
        BagError: It is no ULog, or pyulog is not installed.
    """
    kind = kind_of(source)
    if kind in POINTERS:
        raise BagError(f"{source}: is {kind.value}")
    pyulog = library("pyulog", "ulog", "ULog")
    try:
        log = pyulog.ULog(str(source), disable_str_exceptions=True)
    except Exception as error:  # pyulog raises whatever the damaged bytes lead to
        reason = " ".join(str(error).split()) or type(error).__name__
        raise BagError(f"{source}: cannot be read as a ULog ({reason:.200})") from error
    found = {f"/{one.name}{f'_{one.multi_id}' if one.multi_id else ''}": one.data for one in log.data_list}
    notes = []
    if log.dropouts:
        lost_sec = sum(one.duration for one in log.dropouts) * 1e-3
        notes.append(f"the logger dropped data {len(log.dropouts)} times, {lost_sec:g} s in all")
    rest = _rest_of(source)
    if rest:
        notes.append(f"the log breaks off: its last {rest} bytes are no whole message")
    if log.file_corruption:
        notes.append("the log is damaged: what could be read was read")
    return found, tuple(notes)


def _rest_of(source: Path) -> int:
    """Bytes behind the last whole message; pyulog passes them over."""
    at, size = _HEAD, source.stat().st_size
    with source.open("rb") as stream:
        while at < size:
            stream.seek(at)
            head = stream.read(_RECORD.size)
            end = at + _RECORD.size + (_RECORD.unpack(head)[0] if len(head) == _RECORD.size else size)
            if end > size:
                return size - at
            at = end
    return 0


def read_ulog(source: Path, fields: Sequence[str]) -> tuple[tuple[Recording, ...], tuple[str, ...]]:
    """Read the wanted numbers of a ULog; its stamps count.

    Raises:
        BagError: It cannot be read, or lacks a field.
    """
    topics, notes = ulog_topics(source)
    if any("damaged" in one for one in notes):
        raise BagError(f"{source}: the log is damaged, expected a whole one")
    wanted: dict[str, dict[str, str]] = {}
    for text in fields:
        path = FieldPath.parse(text, topics)
        if path.topic not in topics:
            raise BagError(f"{source}: holds no topic {path.topic}, expected one of {', '.join(sorted(topics)):.300}")
        name = str(path).removeprefix(path.topic).removeprefix(".")
        if name not in topics[path.topic]:
            there = ", ".join(sorted(topics[path.topic]))
            raise BagError(f"{source}: {path.topic} has no field {name}, expected one of {there:.300}")
        wanted.setdefault(path.topic, {})[text] = name
    found = []
    for topic, names in wanted.items():
        data = topics[topic]
        found.append(
            Recording(
                name=topic,
                fields=tuple(names),
                stamps_ns=np.asarray(data[_STAMP], dtype=np.int64) * _MICROSECOND_NS,
                values=np.stack([np.asarray(data[name], dtype=np.float64) for name in names.values()], axis=1),
            )
        )
    return tuple(found), notes
