"""`dcmg replay`: its options, and the keys that steer it."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

from bags.golden import golden_path
from dcmg.cli import main
from dcmg_bringup.keys import DOWN, RIGHT, SPACE, UP, split_keys

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


def test_another_observer_and_detector(dcmg: Dcmg) -> None:
    """Kinds and options of observer and detector can be chosen on the command line."""
    code, out, err = dcmg(
        "replay", golden_path("biased"), "--json", "--observer", "full_order", "--observer-option", "unknown_inputs=2",
        "--detector", "fixed", "--detector-option", "margin=1000", "--detector-option", "settle_sec=0.1",
        "--detector-option", "calibrate_sec=0.5",
    )  # fmt: skip
    assert code == 0, err
    assert all(link["first_alarm_sec"] is None for link in json.loads(out)["links"])


def test_refused_design_is_told(dcmg: Dcmg) -> None:
    """A design that the data do not allow is named with its reason, also beside tables."""
    code, out, err = dcmg(
        "replay", golden_path("biased"), "--observer", "full_order", "--observer-option", "unknown_inputs=3"
    )
    assert code == 0, err
    assert "not monitored" in out
    told = [line for line in err.splitlines() if line.startswith("not monitored: /dgu_")]
    assert told
    assert all(": refused: " in line for line in told)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--rate", "2"), "--rate: expected only together with --publish"),
        (("--monitors",), "--monitors: expected only together with --publish"),
        (("--detector-option", "margin"), "--detector-option margin: expected NAME=VALUE"),
        (("--publish", "--rate", "fast"), "--rate fast: expected a positive number or max"),
        (("--publish", "--rate", "0"), "--rate 0: expected a positive number or max"),
        (("--publish", "--remap", "a=b"), "--remap a=b: expected OLD:=NEW"),
        (("--publish", "--remap", "/a:=/b"), "holds no topic '/a'"),
        (("--publish", "--topics", "("), "topic filter '('"),
        (("--publish", "--monitors", "--loop"), "--loop, --start-offset: expected without live monitors"),
        (("--publish", "--detector", "cusum"), "expected only together with --monitors or --attach"),
        (("--publish", "--attach", "dgu_1"), "--attach dgu_1: expected one of monitor_1, monitor_2, monitor_3"),
        (("--publish", "--monitors", "--exclude", "/dgu_2/received/.*"), "monitor_2 needs /dgu_2/received/dgu_1"),
    ],
)
def test_wrong_options_are_named(dcmg: Dcmg, arguments: tuple[str, ...], message: str) -> None:
    """One line says what is wrong with an option, before anything is published."""
    code, out, err = dcmg("replay", golden_path("biased"), *arguments)
    assert (code, out) == (2, "")
    assert message in " ".join(err.split())


def test_a_player_that_is_not_there(dcmg: Dcmg, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a replay on this machine, `dcmg player` says so."""
    monkeypatch.setattr("dcmg_bringup.player_commands.running_systems", list)
    code, _, err = dcmg("player", "pause")
    assert code == 2
    assert "the replays on this machine are: none" in err


def test_keys_are_told_apart() -> None:
    """Arrow keys arrive as three characters, others as one."""
    assert split_keys(f"{SPACE}{RIGHT}x{UP}{DOWN}{SPACE}") == [SPACE, RIGHT, "x", UP, DOWN, SPACE]
