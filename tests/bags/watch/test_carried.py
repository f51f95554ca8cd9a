"""Designs travel in the bag of their run and run again with the same bits, whatever the processor would design."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from bags.mcap.errors import BagError
from bags.runs.offline import simulate_to_bag
from bags.runs.reader import read_run
from bags.runs.replay import carried_by, histories_of, replay
from bags.runs.run_record import RunRecord
from bags.watch import designs
from bags.watch.carried import Carried, difference, read_carried
from bags.watch.designs import design_run, design_scenario
from bags.watch.histories import write_histories
from bags.watch.scenarios import load_scenario
from bags.wire.settings import settings_of
from dgu_sim.scenario import Scenario
from monitor import link_design

if TYPE_CHECKING:
    from collections.abc import Callable

SCENARIOS = Path(__file__).parents[3] / "dcmg" / "scenarios"
EVERYTHING = (
    "duration_sec=0.4",
    "attacks=[]",
    "monitor.local={}",
    "monitor.plausibility={}",
    "monitor.response={}",
    "monitor.team={samples: 120}",
)
KERNELS = """
import sys
from pathlib import Path
from bags.runs.reader import read_run
from bags.runs.replay import replay
for path in map(Path, sys.argv[1:]):
    run = read_run(path)
    again = replay(run)
    assert again.designs == run.designs, path
    for name in ("estimate", "residual", "threshold", "alarm", "phase"):
        assert getattr(again, name).tobytes() == getattr(run, name).tobytes(), (path, name)
"""


def _scenario(*overrides: str) -> Scenario:
    return load_scenario(SCENARIOS / "gallo_six_dgu.yaml", (*EVERYTHING, *overrides))


@pytest.fixture(name="bag", scope="module")
def _bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return simulate_to_bag(_scenario(), tmp_path_factory.mktemp("carried") / "bag")


@pytest.fixture(name="run", scope="module")
def _run(bag: Path) -> RunRecord:
    return read_run(bag)


def test_every_part_of_a_run_is_carried(run: RunRecord, bag: Path) -> None:
    """Observers, input estimators, own-state modules and the team come out of the bag with the bytes they went in."""
    scenario = _scenario()
    fresh, carried = design_scenario(scenario), read_carried(bag)
    assert carried.records == fresh.told()
    assert len(carried.records) == 14 + 6 + 14 + 6
    assert carried_by(run).records == carried.records
    assert carried_by(run).settings == carried.settings == settings_of(scenario)
    taken = design_scenario(scenario, carried=carried)
    assert taken.told() == carried.records
    assert carried.anew(taken.told()) == ()


def test_carried_designs_are_not_designed_again(bag: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is solved where everything is carried."""

    def never(*_: object, **__: object) -> None:
        raise AssertionError("designed")

    for place in ("bags.watch.designs.design_link", "bags.watch.designs.design_own", "bags.watch.team.design_team"):
        monkeypatch.setattr(place, never)
    monkeypatch.setattr("bags.watch.designs.input_estimators.design", never)
    replay(bag)


def _scaled(run: RunRecord, scale: float) -> RunRecord:
    """The run as if another processor had designed its observers: every matrix a little different."""

    def moved(value: object) -> object:
        if isinstance(value, list):
            return [moved(one) for one in value]
        return value * scale if isinstance(value, float) else value

    def other(text: str) -> str:
        document = json.loads(text)
        found = document.get("running", document)
        found["matrices"] = {name: moved(rows) for name, rows in found["matrices"].items()}
        return json.dumps(document)

    moved_ones = {link: replace(one, certificate=other(one.certificate)) for link, one in run.designs.items()}
    return replace(run, designs=moved_ones)


def test_what_runs_is_what_the_bag_says(run: RunRecord) -> None:
    """A replay steps the recorded matrices, not those that this machine would design."""
    apart = 1.0 + 2.0**-30
    elsewhere = _scaled(run, apart)
    again = replay(elsewhere)
    assert again.designs == elsewhere.designs
    assert again.residual.tobytes() != run.residual.tobytes()
    anew = replay(elsewhere, redesign=True)
    assert anew.designs == run.designs
    assert anew.residual.tobytes() == run.residual.tobytes()
    for link, design in elsewhere.designs.items():
        assert difference(design, run.designs[link]) == pytest.approx(apart - 1.0, rel=1e-6)


@pytest.mark.parametrize(
    ("override", "anew"),
    [
        ("monitor.detector.options.margin=7", set()),
        ("monitor.local.load_range_a=0.3", set()),
        ("monitor.plausibility.limits.margin=0.2", set()),
        ("monitor.team.margin=7", set()),
        ("monitor.response=null", set()),
        ("monitor.observer.options={strategy: dual_lqr, decay: 0.4}", {"links"}),
        ("monitor.local.decay=0.4", {"local"}),
        ("monitor.plausibility.estimator={kind: op_uie}", {"inputs"}),
        ("monitor.team.structure=leader", {"team"}),
    ],
)
def test_only_what_is_changed_is_designed_anew(bag: Path, override: str, anew: set[str]) -> None:
    """Another detector keeps the observers; another observer keeps the rest."""
    carried = read_carried(bag)
    found = design_scenario(_scenario(override), carried=carried).told()
    kinds = {
        "team" if name.endswith("/grid") else "inputs" if "/input_design/" in name else _kind(name)
        for name in carried.anew(found)
    }
    assert kinds == anew


def _kind(name: str) -> str:
    _, monitor, _, source = name.split("/")
    return "local" if monitor == source else "links"


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("full_order", "{}"),
        ("reduced_order", "{allow_blind: true}"),
        ("delayed", "{delay: 2}"),
        ("op_uie", "{future: 2}"),
        ("cl_uie", "{future: 2}"),
    ],
)
@pytest.mark.parametrize("output", ["[V, I_t, v]", "[V, I_t]"])
def test_every_kind_of_observer_is_carried(kind: str, options: str, output: str) -> None:
    """Each method's observer, accepted or refused, comes back from its document: same channels, same bits."""
    overrides = [f"dgus.{dgu}.output={output}" for dgu in range(6)]
    scenario = load_scenario(
        SCENARIOS / "gallo_six_dgu.yaml",
        ["attacks=[]", "history.samples=60", f"monitor.observer={{kind: {kind}, options: {options}}}", *overrides],
    )
    scenario = scenario.model_copy(update={"lines": scenario.lines[:1], "dgus": scenario.dgus[:2]})
    made = design_scenario(scenario)
    again = design_scenario(scenario, carried=Carried(settings=settings_of(scenario), records=made.told()))
    for one, other in zip(made.links, again.links, strict=True):
        assert (one.document, one.channels, one.blind, one.verdict) == (
            other.document,
            other.channels,
            other.blind,
            other.verdict,
        )
        assert one.accepted == other.accepted
        if one.observer is None or other.observer is None:
            continue
        y = tuple(np.random.default_rng(3).normal(size=one.observer.outputs).tolist())
        state, twin = one.observer.init((), y), other.observer.init((), y)
        for _ in range(5):
            state, said = one.observer.step(state, (), y)
            twin, same = other.observer.step(twin, (), y)
            assert (said, tuple(state)) == (same, tuple(twin))


def test_incomplete_designs_are_made_anew(run: RunRecord) -> None:
    """A bag whose designs lack what runs, as of older versions, is replayed with fresh ones."""

    def without(text: str) -> str:
        return json.dumps({key: value for key, value in json.loads(text).items() if key not in {"running", "matrices"}})

    old = {link: replace(one, certificate=without(one.certificate)) for link, one in run.designs.items()}
    again = replay(replace(run, designs=old))
    assert again.residual.tobytes() == run.residual.tobytes()
    assert again.designs == run.designs


def test_a_bag_without_designs_is_refused(tmp_path: Path) -> None:
    """Whoever asks for designs of a bag of histories is told in one line."""
    path = write_histories(_scenario("monitor.team=null"), [1], tmp_path / "history")
    with pytest.raises(BagError, match="holds no designs"):
        read_carried(path)


def test_a_history_is_designed_once(monkeypatch: pytest.MonkeyPatch, run: RunRecord) -> None:
    """14 links from 6 DGUs need 6 designs."""
    calls: list[str] = []
    design: Callable[..., object] = link_design.design_link

    def counted(*arguments: object) -> object:
        calls.append(str(arguments[0]))
        return design(*arguments)

    monkeypatch.setattr(designs, "design_link", counted)
    scenario = _scenario("monitor.local=null", "monitor.plausibility=null", "monitor.response=null")
    found = design_run(run.topics, settings_of(scenario), histories_of(run))
    assert (len(found.links), len(calls)) == (14, 6)


@pytest.mark.parametrize("kernel", ["Haswell", "Nehalem"])
def test_other_kernels_repeat_the_run(bag: Path, kernel: str) -> None:
    """With the BLAS kernels of other processors the bag's own designs give the recorded bits."""
    environment = {**os.environ, "OPENBLAS_CORETYPE": kernel}
    subprocess.run([sys.executable, "-c", KERNELS, str(bag)], env=environment, check=True, timeout=300)
