"""`--designs` and `--redesign`: which designs run, and what is said about it."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pytest

from bags.golden import golden_path
from bags.runs.reader import read_run
from bags.watch.carried import read_carried
from bags.watch.histories import write_histories
from bags.watch.scenarios import load_scenario
from dcmg.cli import main

if TYPE_CHECKING:
    from pathlib import Path

Dcmg = Callable[..., tuple[int, str, str]]


@pytest.fixture
def dcmg(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Dcmg:
    """`dcmg` in this process: exit code, standard output, standard error."""

    def call(*arguments: str | Path) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["dcmg", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        captured = capsys.readouterr()
        return int(ended.value.code or 0), captured.out, captured.err

    return call


def test_a_replay_takes_the_recorded_designs_and_says_nothing(dcmg: Dcmg) -> None:
    """Another detector keeps the observers."""
    code, _, said = dcmg("replay", golden_path("biased"), "--json", "--detector-option", "margin=7")
    assert code == 0, said
    assert "designed anew" not in said


def test_redesign_tells_how_far_each_design_lies(dcmg: Dcmg) -> None:
    """One line a link, with the largest relative difference of a matrix: rounding, on any processor."""
    code, _, said = dcmg("replay", golden_path("biased"), "--json", "--redesign")
    assert code == 0, said
    lines = [line for line in said.splitlines() if line.startswith("designed anew: ")]
    assert [line.split(": ")[1] for line in lines] == list(read_carried(golden_path("biased")).records)
    for line in lines:
        assert float(line.split("within ")[1].split()[0]) < 1e-6  # LAPACK's last digits on other processors


def test_another_observer_is_said_to_be_designed_anew(dcmg: Dcmg) -> None:
    """What the bag does not hold is made, and said."""
    code, _, said = dcmg(
        "replay", golden_path("biased"), "--json", "--observer", "full_order", "--observer-option", "strategy=dual_lqr",
        "--observer-option", "decay=0.3",
    )  # fmt: skip
    assert code == 0, said
    assert said.count("designed anew: /dgu_") == len(read_run(golden_path("biased")).links)


def test_designs_of_another_run_are_taken_over(dcmg: Dcmg, tmp_path: Path) -> None:
    """A run with another seed, and so other histories, steps the observers of the bag; what does not fit is named."""
    first, second, third = (tmp_path / name for name in ("first", "second", "third"))
    short = ("simulate", "gallo_six_dgu", "--duration", "0.2", "--no-plots", "--json", "--set", "attacks=[]")
    assert dcmg(*short, "--out", first)[0] == 0
    code, _, said = dcmg(*short, "--out", second, "--seed", "9", "--designs", first / "bag")
    assert (code, "designed anew" in said) == (0, False), said
    assert read_carried(second / "bag").records == read_carried(first / "bag").records
    assert not np.array_equal(read_run(second / "bag").histories[0].x, read_run(first / "bag").histories[0].x)
    other = "monitor.observer={kind: full_order, options: {strategy: dual_lqr, decay: 0.3}}"
    code, _, said = dcmg(*short, "--out", third, "--designs", first / "bag", "--set", other)
    assert code == 0, said
    assert "designed anew" in said
    assert "/dgu_1/design/dgu_2" in said


def test_a_bag_without_designs_is_refused_in_one_line(dcmg: Dcmg, tmp_path: Path) -> None:
    """Nothing starts."""
    from dcmg.shipped import scenario_path  # noqa: PLC0415 - used here alone

    history = write_histories(load_scenario(scenario_path("gallo_six_dgu")), [1], tmp_path / "history")
    code, _, said = dcmg("simulate", "gallo_six_dgu", "--out", tmp_path / "run", "--designs", history)
    assert code != 0
    assert said.strip().endswith("holds no designs (topics of type dcmg_msgs/msg/Design), expected the bag of a run")
    assert not (tmp_path / "run").exists()
