"""The wheel of the root distribution: what `pip install .` gives to those who do not work in the checkout."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.version import Version

ROOT = Path(__file__).parents[1]
PACKAGES = ("bags", "dgu_sim", "monitor")
ALSO_NEEDED = ("ros_ws/src/dcmg_msgs", "pyproject.toml", "README.md", "LICENSE")


@pytest.fixture(scope="module")
def wheel_files(tmp_path_factory: pytest.TempPathFactory) -> set[str]:
    """Build the wheel from a copy of the tree, links kept as links, and list what is in it."""
    tree, wheels = tmp_path_factory.mktemp("tree"), tmp_path_factory.mktemp("wheels")
    for name in (*PACKAGES, *ALSO_NEEDED):
        source, target = ROOT / name, tree / name
        if source.is_dir():
            shutil.copytree(source, target, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy2(source, target)
    pip = (sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation")
    subprocess.run([*pip, "--wheel-dir", wheels, tree], check=True)
    with zipfile.ZipFile(next(wheels.glob("dcmg-*.whl"))) as wheel:
        return set(wheel.namelist())


def test_wheel_holds_every_module(wheel_files: set[str]) -> None:
    """No module of the three packages is left out, as one in a folder without __init__.py would be."""
    modules = {str(path.relative_to(ROOT)) for package in PACKAGES for path in (ROOT / package).rglob("*.py")}
    assert modules <= wheel_files
    assert {f"{package}/py.typed" for package in PACKAGES} <= wheel_files


def test_wheel_holds_the_message_definitions(wheel_files: set[str]) -> None:
    """The link bags/mcap/msg becomes real files: bags are written and read without the ROS workspace."""
    messages = {f"bags/mcap/msg/{path.name}" for path in (ROOT / "ros_ws/src/dcmg_msgs/msg").glob("*.msg")}
    assert messages
    assert messages <= wheel_files


def test_wheel_holds_the_golden_bags(wheel_files: set[str]) -> None:
    """Whoever installs the distribution has recorded runs to try things on, with what they must give."""
    folder = ROOT / "bags/golden"
    golden = {str(path.relative_to(ROOT)) for path in folder.rglob("*") if path.suffix in {".mcap", ".yaml", ".json"}}
    assert any(path.endswith(".mcap") for path in golden)
    assert golden <= wheel_files


def test_lower_bounds_are_what_the_lowest_run_installs() -> None:
    """Every dependency has a lower bound, and `make lowest` tries that very version."""
    lines = (ROOT / ".ci/lowest.txt").read_text(encoding="utf-8").splitlines()
    tried: dict[str, Version] = {}
    for line in lines:
        name, _, rest = line.partition("==")
        if rest:
            tried.setdefault(name, Version(rest.split(";")[0].strip()))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for wanted in map(Requirement, project["dependencies"]):
        (bound,) = [one.version for one in wanted.specifier if one.operator == ">="]
        assert tried[wanted.name] == Version(bound), wanted.name
    every = [*project["dependencies"], *(one for extra in project["optional-dependencies"].values() for one in extra)]
    assert not [one for one in every if not Requirement(one).specifier]
