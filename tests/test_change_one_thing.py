"""docs/change_one_thing.md names files that exist."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs/change_one_thing.md"


def test_every_file_of_the_page_exists() -> None:
    """Whoever follows the page finds what it names."""
    named = re.findall(r"`((?:dgu_sim|monitor|bags|dcmg|ros_ws|tests)/[^`]*)`", PAGE.read_text(encoding="utf-8"))
    assert len(named) > 20
    assert [name for name in named if not (ROOT / name).exists()] == []
