"""Received streams against the histories of their sources, from the bag of a run."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from typer.testing import CliRunner

from bags.golden import golden_path
from bags.mcap.errors import BagError
from bags.runs.history_check import check_histories
from dcmg.commands.imports import app
from dgu_sim.grid import Link

if TYPE_CHECKING:
    from pathlib import Path


NOISE: dict[str, object] = {"received_std": (0.01, 0.01, 0.001)}  # of the golden runs
NOISY = ["--received-std", "0.01,0.01,0.001"]


def test_attack_free_streams_fit_and_attacked_ones_do_not_from_the_attack_on() -> None:
    """Whatever the loads do a stream fits its history; a bias is off from the window that first holds it."""
    free = check_histories(golden_path("attack_free"), None, None, NOISE)
    assert len(free) > 1
    assert all(one.found.fits for one in free), [one.found.verdict for one in free]
    biased = {one.link: one for one in check_histories(golden_path("biased"), None, None, NOISE)}
    off = {link: one for link, one in biased.items() if not one.found.fits}
    assert off
    assert len(off) < len(biased)
    for one in off.values():
        stretches = one.over_time(0.5)
        assert one.first_sec is not None
        assert all(part.misfit <= 1.0 for part in stretches if part.start_sec + 0.5 <= one.first_sec)
        assert max(part.misfit for part in stretches if not np.isnan(part.misfit)) > 1.0


def test_the_command_tells_and_its_exit_code_says(tmp_path: Path) -> None:
    """0 fits, 1 does not; one link on request; a link that is not there is one line."""
    run = CliRunner().invoke
    good = run(app, ["check-history", str(golden_path("attack_free")), "--json", *NOISY], catch_exceptions=False)
    assert good.exit_code == 0
    document = json.loads(good.stdout)
    assert all(one["fits"] and one["first_sec"] is None and one["misfit"] for one in document)
    link = document[0]["link"]
    bad = run(app, ["check-history", str(golden_path("biased")), *NOISY], catch_exceptions=False)
    assert bad.exit_code == 1
    assert "does not fit its history from sample" in bad.stdout
    one = run(app, ["check-history", str(golden_path("attack_free")), "--link", link, *NOISY], catch_exceptions=False)
    assert one.stdout.startswith(f"link {link}: fits its history")
    with pytest.raises(BagError, match="no received stream of link 8-9"):
        check_histories(golden_path("attack_free"), None, Link(8, 9), {})
    with pytest.raises(BagError):
        check_histories(golden_path("attack_free"), tmp_path / "none", None, {})
