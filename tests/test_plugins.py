"""A user's installed package adds kinds: listed, checked, run, replayed, named in the bag; broken ones are one line."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
WOBBLE = ROOT / "tests/plugins/dcmg_wobble"
ATTACKED = (
    "gallo_six_dgu",
    "--no-plots",
    "--set",
    "attacks=[{kind: wobble, link: 1-2, start_sec: 3, voltage_v: 0.5}]",
    "--set",
    "monitor.detector={kind: n_of_m, options: {n: 1, m: 2, kind: jump, options: {jump: 0.01}}}",
    "--set",
    "monitor.observer={kind: brisk}",
    "--duration",
    "4",
)


@dataclass(frozen=True, slots=True)
class Finished:
    """A command that has ended: exit code and what it wrote."""

    code: int
    out: str
    err: str

    @property
    def document(self) -> Any:  # noqa: ANN401 - JSON
        """What it printed as JSON."""
        return json.loads(self.out)


@dataclass(frozen=True, slots=True)
class Place:
    """A folder that packages are installed into."""

    folder: Path

    def dcmg(self, *words: str | Path) -> Finished:
        """Run `dcmg` where these packages are installed."""
        environment = {**os.environ, "PYTHONPATH": str(self.folder)}
        command = [sys.executable, "-m", "dcmg", *map(str, words)]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        return Finished(done.returncode, done.stdout, done.stderr)

    def add(self, package: str, version: str, group: str, points: str, module: str = "") -> Place:
        """Put a package there as pip would: what it is called, its entry points, and a module of its name."""
        (self.folder / f"{package}.py").write_text(module)
        metadata = self.folder / f"{package}-{version}.dist-info"
        metadata.mkdir(parents=True)
        (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: {version}\n")
        (metadata / "entry_points.txt").write_text(f"[{group}]\n{points}\n")
        return self


@pytest.fixture(scope="module")
def wobble(tmp_path_factory: pytest.TempPathFactory) -> Place:
    """The sample package, installed by pip beside dcmg."""
    source, folder = tmp_path_factory.mktemp("source") / "wobble", tmp_path_factory.mktemp("installed")
    shutil.copytree(WOBBLE, source, ignore=shutil.ignore_patterns("__pycache__"))
    pip = (sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation", "--no-index")
    subprocess.run([*pip, "--target", folder, source], check=True)
    return Place(folder)


@pytest.fixture(scope="module")
def bag(wobble: Place, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulation with the attack and the detector of the sample package."""
    out = tmp_path_factory.mktemp("run") / "out"
    done = wobble.dcmg("simulate", *ATTACKED, "--json", "--out", out)
    assert done.code == 0, done.err
    (attack,) = done.document["attacks"]
    assert (attack["kind"], attack["accused_by"]) == ("wobble", "1-2")
    return out / "bag"


def test_the_page_shows_the_sample_package() -> None:
    """Whoever copies docs/plugins.md has the package that these tests use."""
    page = (ROOT / "docs/plugins.md").read_text(encoding="utf-8")
    for name in ("pyproject.toml", "dcmg_wobble/attack.py", "dcmg_wobble/detector.py", "dcmg_wobble/observer.py"):
        assert (WOBBLE / name).read_text(encoding="utf-8") in page


@pytest.fixture
def place(tmp_path: Path) -> Place:
    """A place of its own for broken packages."""
    folder = tmp_path / "installed"
    folder.mkdir()
    return Place(folder)


def test_plug_ins_are_listed_with_package_and_version(wobble: Place, place: Place) -> None:
    """`dcmg plugins` names what is installed, `dcmg attack kinds` what an attack of it wants."""
    listed = wobble.dcmg("plugins", "--json")
    assert listed.code == 0
    found = {(one["group"], one["kind"], one["package"], one["version"], one["problem"]) for one in listed.document}
    assert found == {
        ("dcmg.attacks", "wobble", "dcmg-wobble", "0.1.0", ""),
        ("dcmg.detectors", "jump", "dcmg-wobble", "0.1.0", ""),
        ("dcmg.observers", "brisk", "dcmg-wobble", "0.1.0", ""),
    }
    shown = wobble.dcmg("attack", "kinds", "wobble")
    assert "dcmg attack start wobble 1-2 --voltage-v ..." in shown.out
    assert "docs/plugins.md" in place.dcmg("plugins").out


def test_parameters_and_options_of_plug_ins_are_checked(wobble: Place, tmp_path: Path) -> None:
    """A wrong parameter is one line with key, value and what was expected, as for shipped kinds."""
    for change, expected in (
        ("attacks.0.voltage_v=-1", "attacks.0.voltage_v = -1"),
        ("attacks.0.voltage=1", "known keys are"),
        ("monitor.detector.options.options.jump=0", "monitor.detector.options.options.jump = 0"),
    ):
        refused = wobble.dcmg("simulate", *ATTACKED, "--set", change, "--out", tmp_path / "out")
        assert refused.code == 2
        assert expected in refused.err
        assert len(refused.err.splitlines()) == 1


def test_the_bag_names_plug_ins_and_is_reproduced_and_replayed(wobble: Place, bag: Path) -> None:
    """Package and version stand in versions.json; the same bits come again, from steps in floats, too."""
    shown = wobble.dcmg("report", bag, "--out", bag.parent / "report")
    assert shown.code == 0, shown.err
    page = (bag.parent / "report" / "report.html").read_text(encoding="utf-8")
    assert "dcmg.attacks/wobble dcmg-wobble 0.1.0" in page
    assert "dcmg.detectors/jump dcmg-wobble 0.1.0" in page
    assert "dcmg.observers/brisk dcmg-wobble 0.1.0" in page
    again = wobble.dcmg("reproduce", bag, "--json")
    assert again.code == 0, again.err
    assert again.document["identical"]
    assert again.err == ""
    replayed = wobble.dcmg("replay", bag, "--json")
    assert replayed.code == 0, replayed.err
    assert [one["accused_by"] for one in replayed.document["attacks"]] == ["1-2"]


def test_what_a_plug_in_says_is_the_same_inside_spoof(wobble: Place, tmp_path: Path) -> None:
    """A second publisher sends what the plug-in makes of the true messages."""
    inside = "attacks=[{kind: spoof, link: 1-2, start_sec: 3, falsify: {kind: wobble, voltage_v: 0.5}}]"
    done = wobble.dcmg("simulate", *ATTACKED, "--set", inside, "--json", "--out", tmp_path / "out")
    assert done.code == 0, done.err
    assert [one["accused_by"] for one in done.document["attacks"]] == ["1-2"]
    assert wobble.dcmg("reproduce", tmp_path / "out/bag").code == 0


def test_a_bag_whose_plug_in_is_missing_or_another_says_so_in_one_line(
    wobble: Place, bag: Path, place: Place, tmp_path: Path
) -> None:
    """Without the package nothing is run; with another version the numbers are given, and a line of warning."""
    for command in ("replay", "reproduce", "script"):
        refused = place.dcmg(command, bag)
        assert refused.code == 2, command
        assert "dcmg-wobble 0.1.0" in refused.err
        assert "not installed" in refused.err
        assert len(refused.err.splitlines()) == 1
    newer = Place(tmp_path / "newer")
    shutil.copytree(wobble.folder, newer.folder)
    (metadata,) = newer.folder.glob("*.dist-info")
    text = (metadata / "METADATA").read_text(encoding="utf-8").replace("Version: 0.1.0", "Version: 0.2.0")
    (metadata / "METADATA").write_text(text, encoding="utf-8")
    for command in ("replay", "reproduce"):
        done = newer.dcmg(command, bag, "--json")
        assert done.code == 0, done.err
        assert len(done.err.splitlines()) == 3  # the attack, the detector, the observer
        assert "here is dcmg-wobble 0.2.0" in done.err


def test_a_study_runs_plug_ins(wobble: Place, tmp_path: Path) -> None:
    """A study names their kinds as any other, in worker processes."""
    study = tmp_path / "study.yaml"
    study.write_text(
        "name: wobbling\nquestion: Is it seen?\nscenario: gallo_six_dgu\nset: [duration_sec=4]\nseeds: 2\n"
        "attack_start_sec: 3.0\nobservers: [{name: ours, kind: full_order, options: {unknown_inputs: 2}}]\n"
        "detectors: [{name: jump, kind: jump, options: {jump: 0.01}}]\n"
        "attacks: [{name: wobble, kind: wobble, link: 1-2, voltage_v: 0.5}]\n"
    )
    done = wobble.dcmg("study", study, "--out", tmp_path / "out")
    assert done.code == 0, done.err


@pytest.mark.parametrize(
    ("group", "points", "module", "expected"),
    [
        ("attacks", "odd = odd:Nowhere", "", "cannot be imported: AttributeError"),
        ("attacks", "odd = odd:Odd", "import nowhere_to_be_found", "cannot be imported: ModuleNotFoundError"),
        ("attacks", "odd = odd:Odd", "Odd = 3", "expected a class that derives from dgu_sim.attacks.Attack"),
        (
            "attacks",
            "odd = odd:Odd",
            "from dgu_sim.attacks import Attack\nclass Odd(Attack):\n    def init(self, context): ...\n",
            "attack odd has no step",
        ),
        ("attacks", "bias = odd:Odd", "Odd = 3", "dcmg itself has a bias too"),
        ("detectors", "odd = odd:Odd", "Odd = 3", "expected a monitor.detectors.Kind"),
        ("observers", "odd = odd:Odd", "Odd = 3", "expected a function design(history, options)"),
        ("detectors", "fixed = odd:Odd", "Odd = 3", "dcmg itself has a fixed too"),
    ],
)
def test_a_plug_in_that_cannot_be_used_is_one_line_and_only_when_it_is_asked_for(
    place: Place, tmp_path: Path, *, group: str, points: str, module: str, expected: str
) -> None:
    """The line names package, version and entry point; whoever does not ask for it notices nothing."""
    place.add("odd", "3.1", f"dcmg.{group}", points, module)
    kind = points.partition(" ")[0]
    change = f"attacks.0.kind={kind}" if group == "attacks" else f"monitor.{group[:-1]}={{kind: {kind}}}"
    refused = place.dcmg("simulate", "gallo_six_dgu", "--set", change, "--out", tmp_path / "out")
    assert refused.code == 2
    assert expected in refused.err
    assert f"odd 3.1 (entry point {points})" in refused.err
    assert len(refused.err.splitlines()) == 1
    listed = place.dcmg("plugins", "--json")
    assert listed.code == 1
    assert [expected in one["problem"] for one in listed.document] == [True]
    assert place.dcmg("--help").code == 0
    if kind == "odd":
        other = place.dcmg("simulate", "gallo_six_dgu", "--duration", "3", "--no-plots", "--out", tmp_path / "other")
        assert other.code == 0, other.err
        kinds = place.dcmg("attack", "kinds", "--json")
        assert "bias" in kinds.document
        assert kinds.err.count("\n") == (group == "attacks")
