"""How much memory an import takes: a recording of many topics, written by the `mcap` library, and imported as typed."""

from __future__ import annotations

import struct
import subprocess
import sys
import time
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from mcap.writer import Writer

from bags.mcap.typestore import schema_text
from bags.mcap.yaml_text import dump

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

_KIND = "geometry_msgs/msg/Vector3Stamped"
_MESSAGE = struct.Struct("<4xIII4s3d")  # stamp, length of the frame's name and the name, numbers
_SECOND_NS = 1_000_000_000
_START_SEC = 1_700_000_000
_KIB_PER_MB = 1024
# from a small process: the peak of a forked one is at first that of its parent
_MEASURED = """
import resource, subprocess, sys
code = subprocess.call(sys.argv[1:], stderr=subprocess.STDOUT)
print(code, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Imported:
    """One command on the recording.

    Attributes:
        command: Of `dcmg import`.
        wall_sec: How long it took [s].
        peak_mb: Most resident memory of its process [MB].
        ok: Whether it went well.
        detail: Its last line where it did not.
    """

    command: str
    wall_sec: float
    peak_mb: float
    ok: bool
    detail: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportMemory:
    """What was measured.

    Attributes:
        messages: In the recording.
        megabytes: Of it on disk [MB].
        limit_mb: What every command must stay below [MB].
        imports: The commands.
    """

    messages: int
    megabytes: float
    limit_mb: float
    imports: tuple[Imported, ...]

    @property
    def passed(self) -> bool:
        """Whether every command went well, below the limit."""
        return all(one.ok and one.peak_mb < self.limit_mb for one in self.imports)

    def document(self) -> dict[str, Any]:
        """For JSON."""
        return {**asdict(self), "passed": self.passed}


def import_memory(
    folder: Path, shape: tuple[int, int], rate_hz: int, limit_mb: float, say: Callable[[str], None]
) -> ImportMemory:
    """Write a recording and import it, as a history and as a stream.

    Args:
        folder: Where to; exists.
        shape: Messages of each topic, and topics, each of one output.
        rate_hz: How many a second.
        limit_mb: What every command must stay below [MB].
        say: Told what happens.
    """
    file = folder / "recording.mcap"
    samples, topics = shape
    say(f"writing {topics * samples} messages")
    _write(file, topics, samples, rate_hz)
    fields = [f"/topic_{number}.vector.x" for number in range(topics)]
    mapping = {"histories": [{"dgu": 1, "y": fields}], "streams": [{"link": "1-2", "y": fields}]}
    (folder / "mapping.yaml").write_text(dump(mapping), encoding="utf-8")
    told = ["--mapping", str(folder / "mapping.yaml"), "--out"]
    imports = []
    for words in (["inspect"], ["history", *told, str(folder / "history")], ["stream", *told, str(folder / "stream")]):
        say(f"dcmg import {words[0]}")
        imports.append(_measured([words[0], str(file), *words[1:]]))
    megabytes = file.stat().st_size / 1e6
    return ImportMemory(messages=topics * samples, megabytes=megabytes, limit_mb=limit_mb, imports=tuple(imports))


def _write(file: Path, topics: int, samples: int, rate_hz: int) -> None:
    with file.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2", "dcmg measure import")
        schema = writer.register_schema(_KIND, "ros2msg", schema_text(_KIND).encode())
        channels = [writer.register_channel(f"/topic_{number}", "cdr", schema) for number in range(topics)]
        for sample in range(samples):
            stamp = _START_SEC * _SECOND_NS + sample * _SECOND_NS // rate_hz
            second, rest = divmod(stamp, _SECOND_NS)
            for number, channel in enumerate(channels):
                value = 48.0 + number + (sample * (number + 3) % 997) * 1e-3
                data = bytearray(_MESSAGE.pack(second, rest, 4, b"lab\0", value, 0.0, 0.0))
                data[1] = 1  # little endian
                writer.add_message(channel, stamp, bytes(data), stamp)
        writer.finish()  # type: ignore[no-untyped-call] # mcap leaves it without a type


def _measured(words: Sequence[str]) -> Imported:
    """Run `dcmg import` in a process of its own."""
    start = time.monotonic()
    command = [sys.executable, "-S", "-c", _MEASURED, sys.executable, "-m", "dcmg", "import", *words]
    run = subprocess.run(command, capture_output=True, text=True, check=True)  # noqa: S603 - our own command
    *lines, last = run.stdout.strip().splitlines()
    code, most_kib = last.split()
    return Imported(
        command=words[0],
        wall_sec=time.monotonic() - start,
        peak_mb=int(most_kib) / _KIB_PER_MB,
        ok=code == "0",
        detail=lines[-1].strip() if lines and code != "0" else "",
    )
