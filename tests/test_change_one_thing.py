"""docs/change_one_thing.md is right: what it says is enough for each change, in a copy of the tree."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs/change_one_thing.md"
_CODE = ("bags", "dcmg", "dgu_sim", "monitor")
_SHORT = ["--duration", "4", "--no-plots", "--json"]

_ATTACK = '''"""Halving."""

from collections.abc import Sequence

from dgu_sim.attacks.context import AttackContext
from dgu_sim.attacks.falsified import shifted
from dgu_sim.attacks.protocol import Attack
from dgu_sim.records import Sample


class Halving(Attack):
    """y^c = y / 2."""

    def init(self, context: AttackContext) -> object:
        """Return nothing: it remembers nothing."""

    def step(self, state: object, samples: Sequence[Sample]) -> tuple[object, tuple[Sample, ...]]:
        """Return the samples, halved."""
        return state, shifted(samples, [tuple(-0.5 * one for one in sample.y) for sample in samples])
'''
_DETECTOR = '''"""Half the thresholds of `fixed`."""

from dataclasses import replace

from monitor.detectors.fixed import FixedOptions, build as build_fixed

KIND = "half"
HalfOptions = FixedOptions


def build(options, sampling_period_sec):
    """Build the detector."""
    made = build_fixed(options, sampling_period_sec)
    return replace(made, margin=0.5 * made.margin)
'''
_OBSERVER = '''"""The full-order observer under another name."""

from monitor.observers import full_order

KIND = "renamed"


def design(history, options):
    """Design it."""
    return full_order.design(history, {"decay": 0.3, **options})
'''
_LOAD = '''class DoubleLoad(Frozen):
    """I_L(t) = 2 half_a."""

    kind: Literal["double"] = Field(description="A constant current.")
    half_a: Number = Field(description="Half of it [A].")

    def current(self, first: int, count: int, sampling_period_sec: float, source: RandomSource) -> FloatArray:
        """Return the current [A], shape (count,)."""
        return np.full(count, 2.0 * self.half_a)

    def nominal(self) -> float:
        """Return the current at t = 0 [A]."""
        return 2.0 * self.half_a


Load: TypeAlias = Annotated[
    DoubleLoad | '''
_TOPIC = """TOLD = Row(
    key="told",
    name="/dgu_{j}/told/dgu_{i}",
    type_name="dcmg_msgs/msg/Output",
    codec=StepCodec.at,
    over=Over.LINKS,
    publisher="monitor_{j}",
    says="the estimate, as an output",
    frame="dgu_{j}",
    numbers={"source": "i"},
    sequences={"y": "states", "u": "inputs"},
    elsewhere={"y": "residual.estimate", "delivered": "residual.alarm"},
    form=forms.OUTPUT,
)
TABLE: tuple[Row[Any], ...] = (
    """
_COMMAND = '''"""`dcmg hello`: says so."""


def hello() -> None:
    """Say hello."""
    print("hello")
'''


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the packages that need no ROS."""
    copy = tmp_path_factory.mktemp("tree")
    for name in _CODE:
        shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__", "*.mcap"))
    return copy


@pytest.fixture
def change(tree: Path) -> Change:
    """Changes the copy in the files of one row of the page, and changes it back."""
    return Change(tree)


class Change:
    """Changes of a tree.

    Args:
        tree: Where.
    """

    def __init__(self, tree: Path) -> None:
        """Change nothing yet."""
        self.tree = tree
        self._row: list[str] = []

    def of(self, what: str) -> Change:
        """Take the row of the page that begins with these words."""
        (row,) = [line for line in PAGE.read_text("utf-8").splitlines() if line.startswith(f"| {what} |")]
        self._row = re.findall(r"`([^`]*/[^`]*)`", "|".join(row.split("|")[:4]))
        return self

    def write(self, name: str, text: str) -> Change:
        """Write a new file."""
        assert any(name == one or (one.endswith("/") and name.startswith(one)) for one in self._row), self._row
        assert not (self.tree / name).exists()
        (self.tree / name).write_text(text)
        return self

    def edit(self, name: str, old: str, new: str) -> Change:
        """Replace a text, which stands there once."""
        assert name in self._row, self._row
        text = (self.tree / name).read_text()
        assert text.count(old) == 1
        (self.tree / name).write_text(text.replace(old, new))
        return self

    def run(self, *arguments: str) -> str:
        """Let the changed tree run a `dcmg` command; what it prints."""
        environment = {**os.environ, "PYTHONPATH": str(self.tree)}
        command = [sys.executable, "-m", "dcmg", *arguments]
        done = subprocess.run(command, cwd=self.tree, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout

    def simulate(self, out: Path, *changes: str) -> dict[str, Any]:
        """The document of a short run."""
        sets = [part for one in changes for part in ("--set", one)]
        document: dict[str, Any] = json.loads(self.run("simulate", "gallo_six_dgu", *_SHORT, "--out", str(out), *sets))
        return document


def test_every_file_of_the_page_exists() -> None:
    """Whoever follows the page finds what it names."""
    named = re.findall(r"`((?:dgu_sim|monitor|bags|dcmg|ros_ws|tests)/[^`]*)`", PAGE.read_text(encoding="utf-8"))
    assert len(named) > 20
    assert [name for name in named if not (ROOT / name).exists()] == []


def test_every_file_of_the_architecture_exists() -> None:
    """The house is drawn as it is: no room or file stands on the page alone."""
    text = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    folders = ("", "ros_ws/src/dcmg_nodes/", "ros_ws/src/dcmg_bringup/")
    named = set(re.findall(r"\b((?:dgu_sim|monitor|bags|dcmg\w*|tests)/[\w/]+(?:\.\w+)?)", text))
    assert len(named) > 40
    assert [name for name in sorted(named) if not any((ROOT / folder / name).exists() for folder in folders)] == []


def test_an_attack_a_detector_and_an_observer(change: Change, tmp_path: Path) -> None:
    """One file and one line each: the attack is listed and ordered, the detector judges, the observer is designed."""
    change.of("an attack").write("dgu_sim/attacks/halving.py", _ATTACK)
    registry = "dgu_sim/attacks/falsifications.py"
    change.edit(registry, '    "covert": Covert,\n', '    "covert": Covert,\n    "halving": Halving,\n')
    change.edit(
        registry,
        "from dgu_sim.attacks.freeze import Freeze\n",
        "from dgu_sim.attacks.freeze import Freeze\nfrom dgu_sim.attacks.halving import Halving\n",
    )
    change.of("a detector").write("monitor/detectors/half.py", _DETECTOR)
    registry = "monitor/detectors/registry.py"
    change.edit(registry, "import calibrated, ", "import half, calibrated, ")
    change.edit(registry, "    fixed.KIND: ", "    half.KIND: Kind(half.HalfOptions, half.build),\n    fixed.KIND: ")
    change.of("an observer").write("monitor/observers/renamed.py", _OBSERVER)
    registry = "monitor/observers/registry.py"
    change.edit(registry, "import full_order, reduced_order", "import full_order, reduced_order, renamed")
    change.edit(registry, '    "delayed": ', '    renamed.KIND: renamed.design,\n    "delayed": ')
    assert "halving" in json.loads(change.run("attack", "kinds", "--json"))
    document = change.simulate(
        tmp_path / "run",
        "attacks=[{kind: halving, link: 1-2, start_sec: 3}]",
        "monitor.detector={kind: half}",
        "monitor.observer={kind: renamed}",
    )
    (attack,) = document["attacks"]
    assert attack["accused_by"] == "1-2"
    assert attack["kind"] == "halving"


def test_a_load_a_plant_a_topic(change: Change, tmp_path: Path) -> None:
    """A load is a class, another plant other matrices, a topic a row: simulated, watched, recorded, read."""
    change.of("a load or a noise").edit("dgu_sim/loads.py", "Load: TypeAlias = Annotated[\n    ", _LOAD)
    change.of("a plant").edit("dgu_sim/matrices.py", "[-1.0, 0.0, 0.0],\n", "[-1.0, 0.0, -0.5],\n")
    topic = change.of("a topic, per step, of what a run has")
    topic.edit("bags/wire/table.py", "TABLE: tuple[Row[Any], ...] = (\n    ", _TOPIC)
    topic.edit("bags/wire/table.py", "ANNOUNCED, ESTIMATE),\n", "ANNOUNCED, ESTIMATE, TOLD),\n")
    document = change.simulate(tmp_path / "run", "dgus.0.load=[{kind: double, half_a: 5}]", "attacks=[]")
    assert not any(link["alarms"] for link in document["links"])
    table = change.run("bag", "info", str(tmp_path / "run" / "bag"))
    assert "/dgu_2/told/dgu_1" in table
    assert json.loads(change.run("replay", str(tmp_path / "run" / "bag"), "--json"))["links"]


def test_a_scenario_and_a_command(change: Change) -> None:
    """A scenario is a file, a command a file and a row."""
    text = (ROOT / "dcmg/scenarios/gallo_six_dgu.yaml").read_text()
    change.of("a shipped scenario or study").write("dcmg/scenarios/another.yaml", text)
    change.of("a sub-command").write("dcmg/commands/hello.py", _COMMAND)
    row = '    _here("scenarios", "List the shipped scenarios.", _RUN),\n'
    change.edit("dcmg/command_table.py", row, f'{row}    _here("hello", "Say hello.", _RUN),\n')
    assert change.run("hello") == "hello\n"
    assert "hello" in change.run("--help")
    assert "another" in [one["name"] for one in json.loads(change.run("scenarios", "--json"))]
