"""A minute of what `dcmg measure soak` does for an hour."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable


def test_a_minute_in_flat_memory(dcmg: Callable[..., Any]) -> None:
    """Six DGUs recorded over ROS 2, checked and replayed bit by bit, every process below 300 MB."""
    finished = dcmg("measure", "soak", "gallo_six_dgu", "--duration", "60", "--json", timeout_sec=200.0)
    assert finished.code == 0, finished.err + finished.out
    report = json.loads(finished.out)
    assert (report["steps"], report["limit_mb"]) == (6000, 300.0)
    assert [stage["name"] for stage in report["stages"]] == ["record", "check", "replay"]
    assert any("recorder" in name for name in report["stages"][0]["peak_mb"])
    assert report["stages"][2]["detail"] == "bit-identical residuals"
