"""Small files that stand for much: whatever reads them says so within 10 s of CPU and 300 MB."""

from __future__ import annotations

import gzip
import os
import struct
import subprocess
import sys
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pytest
import zstandard
from pyarrow import parquet

from bags.golden.runs import golden_path

if TYPE_CHECKING:
    from pathlib import Path

MOST_SEC = 10.0
MOST_MB = 300.0
GIVEN_UP_SEC = 120
# from a small process: the peak of a forked one is at first that of its parent
MEASURED = """
import resource, subprocess, sys
code = subprocess.call(sys.argv[1:], stdout=subprocess.DEVNULL)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(code, used.ru_utime + used.ru_stime, used.ru_maxrss)
"""
MAGIC = b"\x89MCAP0\r\n"
_NAMES = "abcdefghi"
ALIASES = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{name}: &{name} [{', '.join(['*' + before] * 9)}]\n" for before, name in pairwise(_NAMES)
)
TEXTS = {
    "aliases": ALIASES,
    "brackets": "[" * 100_000,
    "dashes": "- " * 100_000,
    "long": "name: " + "x" * 15_900_000,
    "keys": "\n".join(f"k{number}: 1" for number in range(1_000_000)),
}
BAG = str(golden_path("biased"))


def _record(opcode: int, content: bytes) -> bytes:
    return bytes([opcode]) + struct.pack("<Q", len(content)) + content


def _text(text: str) -> bytes:
    return struct.pack("<I", len(text)) + text.encode()


def _zeros(gigabytes: float) -> bytes:
    """Zeros, compressed with zstd to a thirty-thousandth."""
    packer = zstandard.ZstdCompressor().compressobj()
    return b"".join(packer.compress(bytes(1_000_000)) for _ in range(round(1000 * gigabytes))) + packer.flush()


def _chunk(content: bytes, size: int) -> bytes:
    return struct.pack("<QQQI", 0, 0, size, 0) + _text("zstd") + struct.pack("<Q", len(content)) + content


def _write_mcaps(folder: Path) -> None:
    packed = _zeros(1.5)
    whole = _record(1, _text("ros2") + _text("x")) + _record(6, _chunk(packed, 1_500_000_000)) + _record(2, bytes(20))
    (folder / "zeros.mcap").write_bytes(MAGIC + whole + MAGIC)
    for name, length in (("long_heads", 1 << 40), ("short_heads", 40)):  # a head every 33 or 49 bytes
        fields = struct.pack("<QQQIIQ", 0, 0, 10, 0, 0, 0) if length == 40 else bytes(24)
        head = b"\x06" + struct.pack("<Q", length) + fields
        (folder / f"{name}.mcap").write_bytes(MAGIC + head * (19_600_000 // len(head)))


def _write_tables(folder: Path) -> None:
    with parquet.ParquetWriter(folder / "nulls.parquet", pa.schema([("a", pa.float64())]), compression="zstd") as out:
        for _ in range(200):
            out.write_table(pa.table({"a": pa.nulls(1_000_000, pa.float64())}))
    with gzip.open(folder / "zeros.csv.gz", "wb", compresslevel=1) as out:
        out.write(b"a,b\n")
        for _ in range(100):
            out.write(b"0,0\n" * 1_000_000)
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "zeros.h5", "w") as out:
        out.create_dataset("x", shape=(300_000_000,), dtype="f8", chunks=(1_000_000,), compression="gzip", fillvalue=0)
    (folder / "one_row.csv").write_bytes(b"a,b\n" + b"1" * 19_000_000)
    (folder / "wide.csv").write_bytes(
        b",".join(b"c%d" % i for i in range(1_000_000)) + b"\n" + b"1," * 999_999 + b"1\n"
    )
    (folder / "quote.csv").write_bytes(b'a,b\n"' + b"1\n" * 9_000_000)


@pytest.fixture(scope="module", name="bombs")
def _bombs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bombs")
    for name, text in TEXTS.items():
        (folder / f"{name}.yaml").write_text(text)
        (folder / name).mkdir()
        (folder / name / "metadata.yaml").write_text(text)
        (folder / name / "x_0.mcap").write_bytes(MAGIC + bytes(100))
    for ending in ("yaml", "mcap", "csv", "parquet"):
        os.mkfifo(folder / f"pipe.{ending}")
    _write_mcaps(folder)
    _write_tables(folder)
    return folder


def _judge(arguments: list[str]) -> None:
    """Run `dcmg` in a process of its own: one line at most, no traceback, no signal, within time and memory."""
    command = [sys.executable, "-S", "-c", MEASURED, sys.executable, "-m", "dcmg", *arguments]
    run = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=True)
    code, cpu_sec, most_kb = run.stdout.splitlines()[-1].split()
    lines = run.stderr.splitlines()
    assert int(code) in {0, 1, 2, 3}, lines[-3:]
    assert sum(line.startswith("dcmg: ") for line in lines) <= 1
    assert not any("Traceback" in line for line in lines), lines[-3:]
    assert float(cpu_sec) < MOST_SEC
    assert float(most_kb) / 1000.0 < MOST_MB


COMMANDS = [
    *((command, name) for name in TEXTS for command in ("bag check", "bag info", "bag repair", "replay")),
    *(("simulate", f"{name}.yaml") for name in (*TEXTS, "pipe")),
    *(("study", f"{name}.yaml") for name in ("aliases", "keys", "pipe")),
    *(("mapping", f"{name}.yaml") for name in ("aliases", "brackets", "pipe")),
    *(
        (command, f"{name}.mcap")
        for name in ("zeros", "long_heads", "short_heads", "pipe")
        for command in ("bag check", "bag info", "bag repair", "import inspect", "import draft")
    ),
    *(
        (command, name)
        for name in (
            "nulls.parquet",
            "zeros.csv.gz",
            "zeros.h5",
            "one_row.csv",
            "wide.csv",
            "quote.csv",
            "pipe.csv",
            "pipe.parquet",
        )
        for command in ("import inspect", "import history")
    ),
]


@pytest.mark.timeout(GIVEN_UP_SEC)
@pytest.mark.parametrize(("command", "name"), COMMANDS)
def test_small_files_that_stand_for_much(command: str, name: str, bombs: Path, tmp_path: Path) -> None:
    """Every command that reads such a file."""
    words, behind = command.split(), ["--out", str(tmp_path / "out")]
    match command:
        case "bag check" | "bag info" | "replay" | "import inspect" | "import draft":
            behind = []
        case "import history":
            behind += ["--dgu", "1", "--y", "a", "--rate", "100"]
        case "mapping":
            words = ["import", "stream", BAG, "--mapping"]
    _judge([*words, str(bombs / name), *behind])


def test_zeros_are_zeros() -> None:
    """The generator of the bombs makes what it says."""
    assert not np.frombuffer(zstandard.ZstdDecompressor().decompressobj().decompress(_zeros(0.001)), np.uint8).any()
