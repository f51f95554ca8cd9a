"""The first thing `make` runs: it must choose a usable Python, or say in one line what the machine lacks."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[1] / "ros_ws" / "make_venv.sh"
PYTHON = Path(sys.executable).resolve()
BROKEN_SHIM = "echo 'pyenv: python3: command not found' >&2; exit 127"
OLD_PYTHON = f"exec {PYTHON} -I -c 'import sys; sys.version_info = (3, 9, 18); exec(sys.stdin.read())'"
# Without pip, an environment is made in no time; where it comes from is what is tested.
GOOD_PYTHON = f'[ "$1" = -m ] && exec {PYTHON} "$@" --without-pip; exec {PYTHON} "$@"'
MACHINE = {
    "uname": '[ "$1" = -s ] && echo Linux || echo x86_64',
    "touch": ': > "$1"',
    "cmake": "",
    "g++": "",
    "python3": GOOD_PYTHON,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What the script did: exit code, its lines on standard error, and the environment's folder."""

    code: int
    lines: list[str]
    venv: Path


def run_script(folder: Path, programs: dict[str, str], **environment: str) -> Outcome:
    """Run the script where PATH holds these programs (name → shell script) and nothing else."""
    path = folder / "bin"
    path.mkdir()
    for name, script in programs.items():
        (path / name).write_text(f"#!/bin/sh\n{script}\n")
        (path / name).chmod(0o755)
    venv = folder / "venv"
    done = subprocess.run(
        ["/bin/sh", SCRIPT, venv], env={"PATH": str(path), **environment}, capture_output=True, text=True, check=False
    )
    assert done.stdout == ""
    return Outcome(code=done.returncode, lines=done.stderr.splitlines(), venv=venv)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"uname": '[ "$1" = -s ] && echo Linux || echo aarch64'}, "x86-64 Linux only, and this is Linux aarch64"),
        ({"uname": '[ "$1" = -s ] && echo Darwin || echo x86_64'}, "x86-64 Linux only, and this is Darwin x86_64"),
        ({"cmake": None}, "cmake is missing: install it"),
        ({"g++": None}, "g++ is missing: install it"),
        ({"python3": None}, "Python 3.11, 3.12 or 3.13 is needed: none is on PATH"),
        ({"python3": BROKEN_SHIM}, "Python 3.11, 3.12 or 3.13 is needed: none is on PATH"),
        ({"python3": OLD_PYTHON}, "Python 3.11, 3.12 or 3.13 is needed: python3 is Python 3.9.18;"),
    ],
)
def test_what_the_machine_lacks_is_one_line(tmp_path: Path, change: dict[str, str | None], said: str) -> None:
    """A machine that cannot run ROS 2 gets one line that names what is missing; nothing is installed."""
    programs = {name: script for name, script in {**MACHINE, **change}.items() if script is not None}
    outcome = run_script(tmp_path, programs)
    assert outcome.code != 0
    assert len(outcome.lines) == 1
    assert said in outcome.lines[0]
    assert not outcome.venv.exists()


@pytest.mark.parametrize(("named", "said"), [("python3.9", "is Python 3.9.18"), ("python7", "does not run")])
def test_named_python_is_never_replaced(tmp_path: Path, named: str, said: str) -> None:
    """An unusable PYTHON=... is refused with its reason, although another Python would do."""
    outcome = run_script(tmp_path, {**MACHINE, "python3.9": OLD_PYTHON}, PYTHON=named)
    assert outcome.code != 0
    assert outcome.lines == [f"PYTHON={named} {said}; wanted: Python 3.11, 3.12 or 3.13."]


@pytest.mark.parametrize("python3", [OLD_PYTHON, BROKEN_SHIM])
def test_takes_the_first_python_that_works(tmp_path: Path, python3: str) -> None:
    """When python3 is too old or a shim that fails, a versioned Python on PATH is used."""
    outcome = run_script(
        tmp_path, {**MACHINE, "python3": python3, "python3.12": BROKEN_SHIM, "python3.13": GOOD_PYTHON}
    )
    assert (outcome.code, outcome.lines) == (0, [])
    assert (outcome.venv / "bin" / "python").exists()
    assert (outcome.venv / "complete").exists()
