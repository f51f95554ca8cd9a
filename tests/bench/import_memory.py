"""`python -m tests.bench.import_memory`: what an import of a long recording of many topics takes, memory above all."""

import argparse
import os
import struct
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from mcap.writer import Writer

from bags.mcap.typestore import typestore
from bags.mcap.yaml_text import dump

KIND = "geometry_msgs/msg/Vector3Stamped"
_PERIOD_NS = 10_000_000
_START_NS = 1_000_000_000_000
_SECOND_NS = 1_000_000_000
_CDR = struct.Struct("<4xiII4x3d")  # header with an empty name, three numbers


def write_recording(file: Path, topics: int, duration_sec: float) -> None:
    """Write a recording with stamped vectors on each topic, a hundred a second."""
    text, _ = typestore().generate_msgdef(KIND)
    with file.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2", "bench")
        schema = writer.register_schema(KIND, "ros2msg", text.encode())
        channels = [writer.register_channel(f"/dgu_{one}/radio", "cdr", schema) for one in range(1, topics + 1)]
        for step in range(round(duration_sec * _SECOND_NS / _PERIOD_NS)):
            stamp = _START_NS + step * _PERIOD_NS
            for number, channel in enumerate(channels):
                values = (48 + 0.001 * (step % 97) + number, 2 + 0.01 * (step % 31), 0.5)
                data = _CDR.pack(*divmod(stamp, _SECOND_NS), 1, *values)
                writer.add_message(channel, stamp, b"\0\1\0\0" + data[4:], stamp, step)
        writer.finish()  # type: ignore[no-untyped-call] # mcap leaves it without a type


def mappings(topics: int) -> dict[str, dict[str, object]]:
    """A link and a DGU for each topic, three outputs each."""
    outputs = {one: [f"/dgu_{one}/radio.vector.{axis}" for axis in "xyz"] for one in range(1, topics + 1)}
    return {
        "stream": {"streams": [{"link": f"{one}-{one % topics + 1}", "y": y} for one, y in outputs.items()]},
        "history": {"histories": [{"dgu": one, "y": y} for one, y in outputs.items()]},
    }


def largest_memory_mb(arguments: Sequence[str]) -> float:
    """Run `dcmg` to its end; the largest resident memory it ever had [MB]."""
    quiet = [(os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)]
    command = [sys.executable, "-m", "dcmg", *arguments]
    process = os.posix_spawn(sys.executable, command, dict(os.environ), file_actions=quiet)
    _, status, used = os.wait4(process, 0)
    if status:
        raise SystemExit(f"dcmg {' '.join(arguments)}: ended with {os.waitstatus_to_exitcode(status)}")
    return used.ru_maxrss / 1024


def main() -> None:
    """Import a recording as streams and as histories, and print the memory that each took."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=1.0)
    parser.add_argument("--topics", type=int, default=20)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="dcmg_") as name:
        folder = Path(name)
        write_recording(folder / "long.mcap", options.topics, 3600.0 * options.hours)
        for kind, mapping in mappings(options.topics).items():
            (folder / f"{kind}.yaml").write_text(dump(mapping))
            words = ("--mapping", str(folder / f"{kind}.yaml"), "--out", str(folder / kind))
            found = largest_memory_mb(["import", kind, str(folder / "long.mcap"), *words])
            print(f"import {kind}: {options.hours:g} h of {options.topics} topics at 100 Hz: {found:.0f} MB")


if __name__ == "__main__":
    main()
