"""A short form of `make torture`: the same cases on every machine."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tests.torture.composed import composed
from tests.torture.damaged import WAYS, damaged
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
