"""Tables of every command at any width: nothing is cut short, and a number stays in one piece."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from rich.console import Console

from bags.golden.runs import golden_path
from dcmg.cli import main
from dcmg.tabular import tabulate

Dcmg = Callable[..., str]
BAG = str(golden_path("biased"))
LISTS = [
    ("scenarios",),
    ("attack", "kinds"),
    ("attack", "kinds", "spoof"),
    ("study", "--list"),
    ("paper", "list"),
    ("measure", "list"),
    ("bag", "info", BAG),
    ("bag", "check", BAG),
    ("compare", BAG, BAG),
    ("reconstruct", BAG, "--link", "1-2"),
]


@pytest.fixture
def dcmg(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Dcmg:
    """`dcmg` in this process: its standard output."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments: str) -> str:
        monkeypatch.setattr(sys, "argv", ["dcmg", *arguments])
        with pytest.raises(SystemExit) as ended:
            main()
        captured = capsys.readouterr()
        assert ended.value.code == 0, captured.err
        return captured.out

    return call


@pytest.mark.parametrize("words", LISTS, ids=lambda words: " ".join(words)[:20])
@pytest.mark.parametrize("columns", [60, 80])
def test_nothing_is_cut_short(
    dcmg: Dcmg, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], columns: int
) -> None:
    """Where there is no room, text goes on in the next line."""
    monkeypatch.setenv("COLUMNS", str(columns))
    assert "…" not in dcmg(*words)


def test_residuals_keep_their_exponent(dcmg: Dcmg, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the table of a run, every number over its threshold stands whole in its cell."""
    document = json.loads(dcmg("simulate", "gallo_six_dgu", "--duration", "6", "--no-plots", "--json", "--out", "run"))
    scores = {f"{link['quiet_score']:.2g}" for link in document["links"]}
    assert any("e-" in score for score in scores)
    for columns in (60, 80, 200):
        monkeypatch.setenv("COLUMNS", str(columns))
        out = dcmg("replay", document["bag"])
        assert "…" not in out
        assert scores <= {cell.strip() for line in out.splitlines() for cell in re.split("[│┃]", line)}


def test_brackets_and_units_are_text() -> None:
    """What looks like markup is a unit or a name."""
    console = Console(width=40, record=True)
    with console.capture() as shown:
        console.print(tabulate(("[bold] of [V]",), [("[red]x[/]",)], title="[i]"))
    assert all(text in shown.get() for text in ("[bold] of [V]", "[red]x[/]", "[i]"))


def test_every_table_is_made_here() -> None:
    """A command that lays out its own table would cut its cells again."""
    root = Path(__file__).parents[2]
    files = [*(root / "dcmg").rglob("*.py"), *(root / "ros_ws/src").rglob("*.py")]
    assert [file.name for file in files if " Table(" in file.read_text("utf-8")] == ["tabular.py"]


@pytest.mark.parametrize(
    ("words", "keys"), [(("scenarios",), {"name", "file"}), (("study", "--list"), {"name", "runs"})]
)
def test_lists_as_json(dcmg: Dcmg, words: tuple[str, ...], keys: set[str]) -> None:
    """What is listed is one JSON document with --json."""
    document = json.loads(dcmg(*words, "--json"))
    assert len(document) >= 4
    assert all(keys <= set(one) for one in document)
    assert all(Path(one["file"]).is_file() for one in document)


def test_the_version_is_said(dcmg: Dcmg) -> None:
    """`dcmg --version`: name, number and what computes."""
    assert re.fullmatch(r"dcmg \d+\.\d+\.\d+\S* \((\w+ kernels|numpy.*)\)\n", dcmg("--version"))
