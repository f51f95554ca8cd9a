"""The command imports what it is asked for: a list, a version or a completed word costs no numerical library."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from typer.main import get_command

from dcmg.cli import app
from dcmg.command_table import COMMANDS
from dcmg.lazy import Command, Group, _imported

if TYPE_CHECKING:
    from pathlib import Path

_DESIGNING = {"bags.mcap.writer", "matplotlib", "pyarrow", "rclpy", "rosbags", "scipy"}
_UNUSED = {"bokeh", "cvxpy", "jinja2", "matplotlib", "pandas", "pyarrow", "rclpy", "scipy", "xarray"}
HEAVY = ("cvxpy", "matplotlib", "numpy", "pyarrow", "pydantic", "rclpy", "rosbags", "scipy", "sklearn")
_SHOW_MODULES = """
import atexit, sys
atexit.register(lambda: sys.stderr.write(repr(sorted(sys.modules))))
sys.argv = ["dcmg", *sys.argv[1:]]
from dcmg.cli import main
main()
"""


def _modules(*arguments: str, **environment: str) -> tuple[str, set[str]]:
    """Standard output of a fresh `dcmg`, and the modules it has imported when it ends."""
    done = subprocess.run(
        [sys.executable, "-c", _SHOW_MODULES, *arguments],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, **environment},
    )
    return done.stdout, set(ast.literal_eval(done.stderr))


@pytest.mark.parametrize(
    ("arguments", "environment", "said"),
    [
        (("--help",), {}, "simulate"),
        (("--version",), {}, "dcmg "),
        (("attack", "--help"), {}, "kinds"),
        ((), {"_DCMG_COMPLETE": "complete_bash", "COMP_WORDS": "dcmg s", "COMP_CWORD": "1"}, "study"),
        ((), {"_DCMG_COMPLETE": "complete_bash", "COMP_WORDS": "dcmg attack st", "COMP_CWORD": "2"}, "stop"),
    ],
)
def test_what_is_only_listed_is_not_imported(
    arguments: tuple[str, ...], environment: dict[str, str], said: str
) -> None:
    """Help, version and completion come without numpy, scipy, pydantic, rosbags or ROS."""
    out, modules = _modules(*arguments, **environment)
    assert said in out
    assert not modules & set(HEAVY)


def test_importing_the_api_imports_none_of_it() -> None:
    """`import dcmg` costs nothing before something of it is used."""
    done = subprocess.run(
        [sys.executable, "-c", "import dcmg, sys; print(sorted(sys.modules))"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert not set(ast.literal_eval(done.stdout)) & set(HEAVY)


def _rows(table: tuple[Command | Group, ...], words: tuple[str, ...] = ()) -> list[tuple[tuple[str, ...], Command]]:
    found: list[tuple[tuple[str, ...], Command]] = []
    for row in table:
        here = (*words, row.name)
        found += [(here, row)] if isinstance(row, Command) else _rows(tuple(row.commands), here)
    return found


def test_all_help_together_imports_nothing_that_runs() -> None:
    """Every command's own help: what reads options has no scipy, no writer of bags, no pictures and no ROS."""
    asked = f"""
import contextlib, io, sys
from typer.main import get_command
from dcmg.cli import app
with contextlib.redirect_stdout(io.StringIO()):
    for line in sys.argv[1:]:
        with contextlib.suppress(SystemExit):
            get_command(app).main([*line.split(), "--help"], prog_name="dcmg")
print(set(sys.modules) & set({_DESIGNING}))
"""
    lines = [
        " ".join((*words, *inner))
        for words, row in _rows(tuple(COMMANDS))
        for inner in [(), *((name,) for name in getattr(_imported(row), "commands", ()))]
    ]
    done = subprocess.run([sys.executable, "-c", asked, *lines], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"


def test_a_simulation_imports_only_what_it_runs(tmp_path: Path) -> None:
    """Ten seconds of six DGUs take longer than the imports before them: no scipy, no pictures, no solver."""
    words = ("simulate", "gallo_six_dgu", "--no-plots", "--duration", "6", "--out", str(tmp_path / "run"))
    out, modules = _modules(*words)
    assert "1-2" in out
    assert not modules & _UNUSED


@pytest.mark.parametrize(("words", "row"), _rows(tuple(COMMANDS)), ids=lambda value: str(value)[:20])
def test_every_row_is_a_command(words: tuple[str, ...], row: Command, capsys: pytest.CaptureFixture[str]) -> None:
    """What the table lists can be called, wherever it is, and its own help begins with the same verb."""
    with pytest.raises(SystemExit) as ended:
        get_command(app).main([*words, "--help"], prog_name="dcmg")
    assert ended.value.code == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert f"Usage: dcmg {' '.join(words)}" in shown
    assert row.does.split()[0] in shown


def test_an_attack_by_hand_imports_no_designs() -> None:
    """Who orders an attack does not wait for scipy, bags or observers before the order goes out."""
    imported = "import dcmg_bringup.attack_commands, sys; print(sorted(sys.modules))"
    done = subprocess.run([sys.executable, "-c", imported], capture_output=True, text=True, check=True)
    designing = {"scipy", "rosbags", "rclpy", "bags.mcap.writer", "monitor.observers"}
    assert not set(ast.literal_eval(done.stdout)) & designing
