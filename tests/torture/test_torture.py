"""A short form of `make torture`: the same cases on every machine."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tests.torture.composed import composed
from tests.torture.damaged import WAYS, damaged
from tests.torture.hostile import entries, hostile
from tests.torture.kills import killed

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.parametrize("seed", [20, 34])
def test_kills(tmp_path: Path, seed: int) -> None:
    """SIGINT to a node, and to the supervisor, as soon as nodes have names: ended, named, nothing left."""
    assert killed(seed, tmp_path).broken == ()


def test_composed_starts(tmp_path: Path) -> None:
    """Runs in one process, each in a new process, end by themselves with all their steps."""
    for seed in range(2):
        assert composed(seed, tmp_path).broken == ()


def test_damaged_bags(tmp_path: Path) -> None:
    """Each way to damage a bag some times: found, and what repair makes of it every reader reads, and was recorded."""
    for seed in range(8 * len(WAYS)):
        assert damaged(seed, tmp_path).broken == ()


def test_hostile_entries(tmp_path: Path) -> None:
    """What is sound is read, and what is changed at random is read or refused in one line, at each entry."""
    for name, entry in entries().items():
        work = tmp_path / name
        work.mkdir()
        entry.read(entry.original, work)
    for seed in range(40 * len(entries())):
        assert hostile(seed, tmp_path).broken == ()
