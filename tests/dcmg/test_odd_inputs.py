"""Odd inputs of every command: exit code 2 (or 1), one line on standard error that names the key, nothing written."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from bags.golden.runs import golden_path
from dcmg.cli import main

Dcmg = Callable[..., tuple[int, str, str]]
BAG = str(golden_path("biased"))
SIX = "gallo_six_dgu"

USAGE = [
    (["simulat"], "simulat"),
    (["simulate"], "SCENARIO"),
    (["simulate", SIX, "--durations", "3"], "--durations"),
    (["simulate", SIX, "more"], "more"),
    (["simulate", SIX, "--duration"], "--duration"),
    (["simulate", SIX, "--duration", "ten"], "--duration"),
    (["simulate", SIX, "--seed", "x"], "--seed"),
    (["simulate", SIX, "--bag-compression", "zip"], "--bag-compression"),
    (["simulate", SIX, "--bag-chunks", "tiny"], "--bag-chunks"),
    (["attack", "strt"], "strt"),
    (["attack", "kinds", "bais"], "bais"),
    (["bag", "inf"], "inf"),
    (["bag", "export", BAG], "--out"),
    (["bag", "export", BAG, "--out", "t", "--format", "xls"], "--format"),
    (["report", BAG, "--level", "2"], "--level"),
    (["report", BAG, "--level", "high"], "--level"),
    (["report", BAG, "--block", "0"], "--block"),
    (["explain", BAG], "--link"),
    (["reconstruct", BAG], "--link"),
    (["paper", "turan-fig9"], "turan-fig9"),
    (["measure", "rocs"], "rocs"),
    (["study", "unseen_attacks", "--seeds", "0"], "--seeds"),
    (["study", "unseen_attacks", "--workers", "-1"], "--workers"),
    (["player", "step", "0"], "STEPS"),
    (["run", SIX, "--pacing", "slow"], "--pacing"),
    (
        ["run", SIX, "--pacing", "realtim"],
        "--pacing': 'realtim' is not one of 'lockstep', 'realtime'. Did you mean realtime?",
    ),
    (["bag", "export", BAG, "--out", "t", "--format", "parket"], "Did you mean parquet?"),
    (["run", SIX, "--rate", "0"], "--rate"),
    (["run", SIX, "--set", "script=[{step: 5, command: load_set, dgu: 2, current_a: 1}]"], "script: 1 commands"),
    (["replay", BAG, "--publish", "--queue", "0"], "--queue"),
]
SCENARIOS = [
    (["no_such"], "no_such"),
    (["gallo_six_dg"], "did you mean gallo_six_dgu?"),
    (["[bold]"], "[bold]"),
    (["./no.yaml"], "./no.yaml: no such file"),
    (["."], "."),
    ([""], "scenario"),
    (["/dev/null"], "/dev/null"),
    ([SIX, "--duration", "0"], "duration_sec"),
    ([SIX, "--duration", "-1"], "duration_sec"),
    ([SIX, "--duration", "nan"], "duration_sec"),
    ([SIX, "--duration", "inf"], "duration_sec"),
    ([SIX, "--duration", "1e308"], "duration_sec"),
    ([SIX, "--seed", "-1"], "seed"),
    ([SIX, "--set", "=1"], "=1"),
    ([SIX, "--set", "a"], "KEY=VALUE"),
    ([SIX, "--set", "dgus.99.id=1"], "dgus.99"),
    ([SIX, "--set", "dgus.x.id=1"], "dgus.x"),
    ([SIX, "--set", "dgus=3"], "dgus"),
    ([SIX, "--set", "dgus.0.capacitance_f=nan"], "capacitance_f"),
    ([SIX, "--set", "lines=[]"], "lines"),
    ([SIX, "--set", "colour=red"], "colour"),
    ([SIX, "--set", "coupling=loose"], "coupling"),
    ([SIX, "--set", "coupling=hold"], "'isolated', 'held' or 'joint'; did you mean held?"),
    ([SIX, "--set", "dgus.0.load=[{kind: stpe}]"], "did you mean step?"),
    ([SIX, "--set", "bag.compression=zstd"], "override 'bag.compression=zstd': bag"),
    ([SIX, "--set", "name=a/../../b"], "name"),
    ([SIX, "--set", "name="], "name"),
    ([SIX, "--set", "noise={kind: pink}"], "pink"),
    ([SIX, "--set", "attacks=[{kind: bais, link: 1-2, start_sec: 5, bias: [1, 1, 1]}]"], "did you mean bias?"),
    ([SIX, "--set", "attacks=[{kind: trajectory, link: 1-2, start_sec: 5}]"], "did you mean uio_stealthy_trajectory?"),
    ([SIX, "--set", "attacks=[{kind: bias, link: 1-2, start_sec: 5, bias: [1, 1]}]"], "bias"),
    ([SIX, "--set", "attacks=[{kind: bias, link: 1-9, start_sec: 5, bias: [1, 1, 1]}]"], "1-9"),
    ([SIX, "--set", "attacks=[{kind: bias, link: 1-2, start_sec: -5, bias: [1, 1, 1]}]"], "start_sec"),
    ([SIX, "--set", "attacks=[{kind: bias, link: 1-2, start_sec: 5, stop_sec: 4, bias: [1, 1, 1]}]"], "stop_sec"),
    ([SIX, "--set", "monitor.observer={kind: oracle}"], "oracle"),
    ([SIX, "--set", "monitor.detector={kind: chi2d}"], "chi2d"),
    ([SIX, "--set", "monitor.local.detector={kind: chi}"], "did you mean chi_squared?"),
    ([SIX, "--set", "monitor.detectr={kind: fixed}"], "did you mean detector?"),
    ([SIX, "--set", "monitor.detector.options.margin=-1"], "margin"),
    ([SIX, "--set", "monitor.detector.options.colour=red"], "colour"),
    ([SIX, "--set", "monitor.observer.options.unknown_inputs=-2"], "unknown_inputs"),
    ([SIX, "--history", "no_such_bag"], "no_such_bag"),
    ([SIX, "--bag-split-mb", "-1"], "split"),
    ([SIX, "--bag-split-mb", "nan"], "split"),
    ([SIX, "--bag-split-sec", "0"], "split"),
    ([SIX, "--bag-topics", "("], "("),
    ([SIX, "--bag-exclude", "*"], "*"),
]
BAGS = [
    (["replay", "nothing"], "nothing"),
    (["replay", "/dev/null"], "/dev/null"),
    (["replay", BAG, "--rate", "2"], "--rate"),
    (["replay", BAG, "--observer", "oracle"], "oracle"),
    (["replay", BAG, "--detector", "cusm"], "cusm"),
    (["replay", BAG, "--detector-option", "margin"], "--detector-option margin"),
    (["replay", BAG, "--detector-option", "margin=x"], "margin"),
    (["replay", BAG, "--set", "seed=3"], "seed"),
    (["replay", BAG, "--history", "nothing"], "nothing"),
    (["replay", BAG, "--publish", "--rate", "fast"], "--rate"),
    (["replay", BAG, "--publish", "--remap", "a"], "--remap"),
    (["replay", BAG, "--publish", "--topics", "["], "["),
    (["replay", BAG, "--publish", "--domain", "500"], "--domain 500"),
    (["report", "nothing"], "nothing"),
    (["report", BAG, "--out", "/proc/report"], "/proc/report"),
    (["report", BAG, "--out", "file.csv/sub"], "file.csv/sub"),
    (["report", BAG, "--set", "monitor.detector={kind: cusm}"], "cusm"),
    (["plot", "nothing"], "nothing"),
    (["plot", BAG, "--figure", "rock"], "did you mean roc?"),
    (["plot", BAG, "--style", "iee"], "did you mean ieee?"),
    (["plot", BAG, "--column", "triple"], "triple"),
    (["plot", BAG, "--links", "12"], "12"),
    (["plot", BAG, "--links", "1-9"], "1-9"),
    (["plot", BAG, "--links", ""], "SOURCE-TARGET"),
    (["plot", BAG, "--figure", "states", "--links", "1-2"], "states"),
    (["plot", BAG, "--figure", "roc", "--from", "1"], "roc"),
    (["plot", BAG, "--figure", "components", "--links", "all"], "one link"),
    (["plot", BAG, "--from", "1", "--to", "0.5"], "from 1 s to 0.5 s"),
    (["plot", BAG, "--from", "99"], "from 99 s"),
    (["plot", BAG, "--to", "nan"], "nan"),
    (["plot", BAG, "--out", "figure.gif"], "figure.gif"),
    (["plot", BAG, "--out", "/proc/figure.pdf"], "/proc/figure.pdf"),
    (["explain", "nothing", "--link", "1-2"], "nothing"),
    (["explain", BAG, "--link", "12"], "12"),
    (["explain", BAG, "--link", "1-9"], "1-9"),
    (["explain", BAG, "--link", "1-2", "--at", "1e308"], "--at"),
    (["explain", BAG, "--link", "1-2", "--at", "nan"], "--at"),
    (["reconstruct", BAG, "--link", "9-9"], "9-9"),
    (["reconstruct", BAG, "--link", "1-2", "--estimator", "magic"], "magic"),
    (["reconstruct", BAG, "--link", "1-2", "--noise-std", "1,2"], "--noise-std"),
    (["reconstruct", BAG, "--link", "1-2", "--option", "delay"], "delay"),
    (["bag", "info", "nothing"], "nothing"),
    (["bag", "check", "nothing"], "nothing"),
    (["bag", "repair", "nothing"], "nothing"),
    (["bag", "export", "nothing", "--out", "t"], "nothing"),
    (["design", "nothing"], "nothing"),
    (["design", BAG, "--dgu", "9"], "9"),
    (["design", BAG, "--observer", "full_ordr"], "full_ordr"),
    (["design", BAG, "--option", "colour=red"], "colour"),
    (["design", BAG, "--option", "a=["], "a=["),
    (["experiment", SIX, "--dgu", "9"], "--dgu 9"),
    (["study", "unsen_attacks"], "did you mean unseen_attacks?"),
    (["study", "unseen_attacks", "--set", "colour=red"], "colour"),
    (["avoided", "no_such"], "no_such"),
    (["import", "inspect", "nothing"], "nothing"),
    (["import", "history", "nothing", "--out", "h", "--dgu", "1", "--y", "a"], "nothing"),
    (["attack", "start", "bias", "one"], "one"),
    (["attack", "start", "bais", "1-2"], "did you mean bias?"),
    (["attack", "start", "bias", "1-2", "--bais", "1"], "bais"),
    (["attack", "start", "bias", "1-2", "--bias", "[1"], "--bias"),
    (["attack", "list", "--domain", "-1"], "--domain -1"),
    (["attack", "list", "--domain", "233"], "--domain 233"),
    (["run", SIX, "--domain", "233"], "--domain 233"),
    (["run", SIX, "--domain", "-1"], "--domain -1"),
    (["run", SIX, "--duration", "long"], "--duration long"),
    (["run", SIX, "--rate", "2"], "--rate 2"),
    (["node", "dgu_9", "--scenario", SIX, "--out", "n"], "dgu_9"),
    (["node", "clock", "--scenario", "no_such", "--out", "n"], "no_such"),
    (["player", "rate", "fast"], "fast"),
    (["monitor", "nothing.yaml", "--history", BAG], "nothing.yaml"),
]
EVERYTHING = [*USAGE, *((["simulate", *words], said) for words, said in SCENARIOS), *BAGS]


@pytest.fixture
def dcmg(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Dcmg:
    """`dcmg` in this process and in an empty folder with one file in it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file.csv").write_text("a,b\n")

    def call(*arguments: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["dcmg", *arguments])
        with pytest.raises(SystemExit) as ended:
            main()
        captured = capsys.readouterr()
        return ended.value.code if isinstance(ended.value.code, int) else 0, captured.out, captured.err

    return call


@pytest.mark.parametrize(
    ("words", "said"), EVERYTHING, ids=lambda value: " ".join(value)[-60:] if isinstance(value, list) else ""
)
def test_an_odd_input_ends_in_one_line_that_names_it(dcmg: Dcmg, tmp_path: Path, words: list[str], said: str) -> None:
    """No traceback, no table, no file."""
    code, out, err = dcmg(*words)
    assert code == 2, out + err
    assert len(err.strip().splitlines()) == 1, err
    assert said.lower() in err.lower()
    assert "Traceback" not in err
    assert out == ""
    assert [path.name for path in tmp_path.rglob("*")] == ["file.csv"]


def test_brackets_in_names_are_names(dcmg: Dcmg, tmp_path: Path) -> None:
    """What looks like markup in a name or a path is printed as it is, and so are the units of the table."""
    words = ["simulate", SIX, "--duration", "6", "--no-plots", "--set", "name='[red]six[/]'", "--out", "[bold]out"]
    code, out, err = dcmg(*words)
    assert code == 0, err
    assert "[red]six[/]" in out
    assert "[bold]out/bag" in out
    assert "[s]" in out
    assert (tmp_path / "[bold]out/bag").is_dir()


DCMG = Path(sys.executable).with_name("dcmg")


@pytest.mark.parametrize(
    ("shell", "codes"),
    [
        ("HOME=/nonexistent $DCMG attack kinds", {0}),
        ("env -u HOME $DCMG simulate gallo_six_dgu --duration 6 --no-plots --out $OUT", {0}),
        ("PYTHONIOENCODING=latin-1 $DCMG attack kinds", {0}),
        ("PYTHONIOENCODING=latin-1 $DCMG simulate gallo_six_dgu --duration 6 --no-plots --out $OUT", {0}),
        ("PYTHONIOENCODING=ascii $DCMG --help", {0}),
        ("mkdir bags && $DCMG bag info $BAG", {0}),
        ("cd /proc && $DCMG simulate gallo_six_dgu --duration 6 --no-plots", {2}),
        ("cd /proc && $DCMG report $BAG --out out", {2}),
        ("$DCMG attack kinds > /dev/full", {2}),
        ("$DCMG bag info $BAG --json > /dev/full", {2}),
        ("$DCMG attack kinds | head -n 1", {0}),
        ("ulimit -n 24; $DCMG simulate gallo_six_dgu --duration 6 --no-plots --out $OUT", {0, 2}),
        ("ROS_DOMAIN_ID= $DCMG attack list --domain 231", {2}),
        ("ROS_DOMAIN_ID=lab7 $DCMG run gallo_six_dgu --duration 6 --out $OUT", {2}),
    ],
)
def test_an_odd_place_ends_in_one_line_at_most(tmp_path: Path, shell: str, codes: set[int]) -> None:
    """Whatever the environment, no traceback; what cannot be done is one line."""
    done = subprocess.run(
        ["/bin/bash", "-c", shell],
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
        cwd=tmp_path,
        env={**os.environ, "DCMG": str(DCMG), "BAG": BAG, "OUT": str(tmp_path / "out")},
    )
    assert done.returncode in codes, done.stderr
    assert "Traceback" not in done.stderr
    assert "Exception ignored" not in done.stderr
    if done.returncode == 2:
        assert len(done.stderr.strip().splitlines()) == 1, done.stderr
        assert done.stderr.startswith("dcmg: ")
