"""How the recorder of a run writes its bag, as chosen on the command line."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from bags.mcap.bag import open_bag
from bags.mcap.check import check

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path


def test_recorder_does_what_it_is_told(dcmg: Callable[..., Any], short_scenario: Path, tmp_path: Path) -> None:
    """Split, compression and topics reach the recorder of a run; nothing is dropped, and the bag says who made it."""
    options = ("--composed", "--no-plots", "--json", "--bag-compression", "lz4", "--bag-split-sec", "0.7")
    chosen = ("--bag-topics", "/dgu_1/.*", "--bag-topics", "/tick", "--bag-exclude", ".*/residual/.*")
    finished = dcmg("run", short_scenario, *options, *chosen, "--out", tmp_path / "run")
    assert finished.code == 0, finished.err
    bag = open_bag(tmp_path / "run/bag")
    report = check(tmp_path / "run/bag")
    assert report.clean, report.damages
    assert len(report.files) >= 2
    assert {name for name in bag.topics if not name.startswith("/dgu_1/")} == {"/tick"}
    assert not [name for name in bag.topics if "residual" in name]
    assert bag.array("/tick").data["step"].tolist() == list(range(200))
    assert json.loads(finished.out)["topics"]["/dgu_1/state"] == 200
    assert json.loads(bag.attachments["host.json"])["processors"] > 0
