"""The wheel of the root distribution: what is in it, and that all of it works in a fresh environment without ROS."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tomllib
import zipfile
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.version import Version

ROOT = Path(__file__).parents[1]
PACKAGES = ("bags", "dcmg", "dgu_sim", "engine", "monitor")
ALSO_NEEDED = ("ros_ws/src/dcmg_msgs", "pyproject.toml", "README.md", "LICENSE")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the wheel from a copy of the tree, links kept as links."""
    tree, wheels = tmp_path_factory.mktemp("tree"), tmp_path_factory.mktemp("wheels")
    for name in (*PACKAGES, *ALSO_NEEDED):
        source, target = ROOT / name, tree / name
        if source.is_dir():
            shutil.copytree(source, target, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy2(source, target)
    pip = (sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation")
    subprocess.run([*pip, "--wheel-dir", wheels, tree], check=True)
    return next(wheels.glob("dcmg-*.whl"))


@pytest.fixture(scope="module")
def wheel_files(wheel: Path) -> set[str]:
    """List what is in the wheel."""
    with zipfile.ZipFile(wheel) as opened:
        return set(opened.namelist())


def test_wheel_holds_every_module(wheel_files: set[str]) -> None:
    """No module of the packages is left out, as one in a folder without __init__.py would be."""
    modules = {str(path.relative_to(ROOT)) for package in PACKAGES for path in (ROOT / package).rglob("*.py")}
    assert modules <= wheel_files
    assert {f"{package}/py.typed" for package in PACKAGES} <= wheel_files
    assert any(path.startswith("engine/_native.") and path.endswith(".so") for path in wheel_files)


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


def _dependencies(name: str, found: set[str]) -> set[str]:
    """Names of all distributions that one needs without extras, itself left out."""
    for text in metadata.requires(name) or []:
        wanted = Requirement(text)
        if wanted.marker is not None and not wanted.marker.evaluate({"extra": ""}):
            continue
        if wanted.name not in found:
            found.add(wanted.name)
            _dependencies(wanted.name, found)
    return found


def _link_dependencies(site: Path) -> None:
    """Put the installed dependencies into another environment, one link a folder or module: nothing is downloaded."""
    for name in _dependencies("dcmg", set()):
        distribution = metadata.distribution(name)
        for top in {file.parts[0] for file in distribution.files or []} - {"..", "__pycache__"}:
            if not (site / top).exists():
                (site / top).symlink_to(Path(str(distribution.locate_file(top))))


@pytest.fixture(scope="module")
def fresh(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A virtual environment with the wheel, installed by pip, and what the wheel says that it needs."""
    folder = tmp_path_factory.mktemp("fresh")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder / "venv"], check=True)
    pip = (sys.executable, "-m", "pip", "--quiet", "--python", str(folder / "venv/bin/python"))
    subprocess.run([*pip, "install", "--no-deps", "--no-index", wheel], check=True)
    (site,) = (folder / "venv/lib").glob("python3*/site-packages")
    _link_dependencies(site)
    return folder


def _run(fresh: Path, *arguments: str, program: str = "dcmg") -> subprocess.CompletedProcess[str]:
    environment = {"PATH": os.environ["PATH"], "HOME": str(fresh), "OPENBLAS_NUM_THREADS": "1"}
    return subprocess.run(
        [fresh / "venv/bin" / program, *arguments],
        capture_output=True,
        text=True,
        check=False,
        cwd=fresh,
        env=environment,
    )


def _ok(fresh: Path, *arguments: str) -> str:
    done = _run(fresh, *arguments)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_there_is_no_ros_and_no_checkout(fresh: Path) -> None:
    """What is tried is the installed wheel."""
    found = _run(
        fresh, "-c", "import dcmg, importlib.util as u; print(dcmg.__file__, u.find_spec('rclpy'))", program="python"
    )
    assert found.stdout.split() == [str(Path(found.stdout.split()[0])), "None"]
    assert found.stdout.startswith(str(fresh / "venv"))


def test_a_run_from_end_to_end(fresh: Path) -> None:
    """Simulate, replay, report, explain; experiment and design; scenarios, studies, attacks."""
    assert "gallo_six_dgu" in {one["name"] for one in json.loads(_ok(fresh, "scenarios", "--json"))}
    simulated = ["simulate", "gallo_six_dgu", "--duration", "6", "--no-plots", "--json", "--out", "s"]
    assert json.loads(_ok(fresh, *simulated))["steps"] == 600
    assert json.loads(_ok(fresh, "replay", "s/bag", "--json"))["steps"] == 600
    _ok(fresh, "report", "s/bag", "--out", "r")
    assert (fresh / "r/report.html").is_file()
    assert json.loads(_ok(fresh, "explain", "s/bag", "--link", "1-2", "--json"))["alarm"]
    _ok(fresh, "experiment", "gallo_six_dgu", "--dgu", "1", "--out", "h")
    assert json.loads(_ok(fresh, "design", "h/history", "--json"))["accepted"]
    assert "unseen_attacks" in _ok(fresh, "study", "--list")
    assert "zero_sum" in _ok(fresh, "attack", "kinds")
    assert _ok(fresh, "--version").startswith("dcmg ")


@pytest.mark.parametrize(
    "arguments",
    [
        ("run", "gallo_six_dgu"),
        ("node", "clock"),
        ("attack", "start", "bias", "1-2"),
        ("attack", "list"),
        ("attach",),
        ("monitor", "mapping.yaml"),
        ("player", "pause"),
        ("replay", "s/bag", "--publish"),
    ],
)
def test_what_needs_ros_is_listed_and_says_what_to_install(fresh: Path, arguments: tuple[str, ...]) -> None:
    """One line, exit code 2."""
    group = arguments[:1] if arguments[0] == "attack" else ()
    assert (arguments[1] if group else arguments[0]) in _ok(fresh, *group, "--help")
    done = _run(fresh, *arguments)
    assert done.returncode == 2
    assert "needs ROS 2, and rclpy" in done.stderr
    assert "make install" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
