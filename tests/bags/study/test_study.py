"""Studies: what they compute, and that nothing is lost when they are interrupted."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from bags.runs.offline import simulate_to_bag
from bags.runs.reader import read_run
from bags.study import (
    LocalPool,
    StudyCell,
    StudyError,
    cells_of,
    check_designs,
    compare,
    load_study,
    operating_points,
    run_study,
)
from bags.study.evaluate import evaluate
from bags.study.figures import write_results
from bags.study.settings import NO_ATTACK, Study
from dcmg.commands.study import shipped_studies
from dcmg.shipped import scenario_path
from dgu_sim.grid import Link
from dgu_sim.scenario import Scenario
from monitor.measures import detect, onsets


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory, tiny_file: Path) -> pa.Table:
    """Table of the tiny study."""
    cells = cells_of(load_study(tiny_file), "tiny.yaml", scenario_path)
    return parquet.read_table(run_study(cells, tmp_path_factory.mktemp("out"), LocalPool(2)))


def _rows(table: pa.Table, **wanted: object) -> list[dict[str, Any]]:
    return [row for row in table.to_pylist() if all(row[name] == value for name, value in wanted.items())]


def test_every_combination_has_a_row(table: pa.Table) -> None:
    """Two observers, two operating points, the attacks and none, four seeds, 14 links."""
    assert table.num_rows == 2 * 2 * 3 * 4 * 14
    assert {row["seed"] for row in table.to_pylist()} == {1, 2, 3, 4}


def test_rows_are_those_of_a_simulated_run(table: pa.Table, cells: tuple[StudyCell, ...], tmp_path: Path) -> None:
    """A bag of the same scenario and seed gives the same detection, delay and residuals, bit for bit."""
    detector = {"kind": "fixed", "options": {"settle_sec": 0.5, "calibrate_sec": 1.5, "margin": 2.0}}
    document = cells[0].scenarios["bias"].model_dump(mode="json")
    document |= {"seed": 2, "monitor": {**document["monitor"], "detector": detector}}
    record = read_run(simulate_to_bag(Scenario.model_validate(document), tmp_path / "bag"))
    for position, link in enumerate(record.links):
        (row,) = _rows(
            table,
            observer="data-driven",
            swept=None,
            attack="bias",
            seed=2,
            source=link.source,
            target=link.target,
        )
        alarm, size = record.alarm[:, position], np.abs(record.residual[:, position]).max(axis=1)
        found = detect(alarm, (300, 400), 0.01)
        assert row["attacked"] == (link == Link(1, 2))
        assert row["residual_after"] == np.nanmax(size[300:])
        assert (row["delay_sec"] if row["detected"] else None) == found.delay_sec
        assert (row["clean_alarm_steps"], row["clean_alarms"]) == (alarm[:300].sum(), onsets(alarm[:300]).sum())


def test_combined_monitors_conclude_as_in_a_run(tiny: Study, tmp_path: Path) -> None:
    """Alarms of a combined monitor are the verdicts of the bag of the same scenario, seed and monitors."""
    limits = {"settle_sec": 0.5, "calibrate_sec": 1.5, "range": [0.1, 0.02]}
    observer = {"name": "combined", "kind": "full_order", "local": {}, "plausibility": {"limits": limits}}
    document = {**tiny.model_dump(mode="json"), **_flat(tiny), "observers": [observer], "seeds": 1}
    document["detectors"] = [{**document["detectors"][0], "sweep": None}]
    (cell,) = cells_of(Study.model_validate(document), "tiny.yaml", scenario_path)
    rows = [row for row in evaluate(cell).to_pylist() if row["attack"] == "bias"]
    scenario = cell.scenarios["bias"].model_dump(mode="json")
    scenario["monitor"] |= {"local": {}, "plausibility": {"limits": limits}}
    scenario["monitor"]["detector"] = {"kind": "fixed", "options": tiny.detectors[0].options}
    record = read_run(simulate_to_bag(Scenario.model_validate(scenario), tmp_path / "bag"))
    assert record.combined is not None
    alarm = record.combined.verdict.accused | record.combined.verdict.suspected
    assert [row["attack_alarm_steps"] for row in rows] == alarm[300:].sum(axis=0).tolist()
    assert [row["clean_alarm_steps"] for row in rows] == alarm[:300].sum(axis=0).tolist()
    (seen,) = (row for row in rows if row["attacked"])
    assert seen["detected"]


def test_what_is_seen_and_what_is_not(table: pa.Table, tmp_path: Path) -> None:
    """A bias is seen at once, a stealthy trajectory as often as no attack at all; both move the mean voltage."""
    points = operating_points([table])
    comparisons = {one.attack: one for one in compare(points, 1e-2)}
    best = comparisons["bias"].best
    assert best is not None
    assert best.detected.value == 1.0
    assert comparisons["stealthy"].best is None
    assert comparisons["stealthy"].mean_voltage_v.value > 1e-3
    for point in points:
        assert point.detected.interval is not None
        assert point.detected.interval.low <= point.detected.value <= point.detected.interval.high
        if point.attack == "stealthy":
            assert point.detected.value == point.by_chance.value
            assert not point.seen
    paths = write_results(points, tuple(comparisons.values()), 1e-2, tmp_path)
    assert all(path.stat().st_size > 0 for path in paths)
    assert "nobody sees it" in (tmp_path / "comparison.md").read_text()


def test_a_lower_threshold_alarms_more(table: pa.Table) -> None:
    """The swept margin moves along the ROC curve: at a tenth of the threshold there are false alarms, else none."""
    rates = {
        (point.observer, point.swept): point.false_alarm_rate.value
        for point in operating_points([table])
        if point.attack == "bias"
    }
    for observer in ("data-driven", "model-based"):
        assert rates[observer, None] == 0.0
        assert rates[observer, 0.2] > 0.05


def test_an_interrupted_study_goes_on(
    cells: tuple[StudyCell, ...], table: pa.Table, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Cells that were finished are not done again, and the table is that of an uninterrupted study."""
    run_study(cells[:1], tmp_path, LocalPool(1))
    done: list[str] = []

    def counted(cell: StudyCell) -> pa.Table:
        (tmp_path / f"did_{cell.observer.name}").touch()
        return evaluate(cell)

    monkeypatch.setattr("bags.study.pool.evaluate", counted)
    path = run_study(cells, tmp_path, LocalPool(1), progress=lambda finished, total: done.append(f"{finished}/{total}"))
    assert done == ["1/2", "2/2"]
    assert [one.name for one in tmp_path.glob("did_*")] == ["did_model-based"]
    assert repr(parquet.read_table(path).to_pylist()) == repr(table.to_pylist())  # NaN is NaN, bit for bit otherwise


def test_other_settings_are_other_cells(tiny: Study, cells: tuple[StudyCell, ...]) -> None:
    """A kept cell is used only for exactly what it was computed from."""
    for change in ({"seeds": 5}, {"attack_start_sec": 3.5}, {"set": ("duration_sec=4.5",)}):
        others = cells_of(Study.model_validate({**tiny.model_dump(), **_flat(tiny), **change}), "other", scenario_path)
        assert {one.key for one in others}.isdisjoint(one.key for one in cells)


def _flat(study: Study) -> dict[str, Any]:
    return {"attacks": [{"name": one.name, **one.attack} for one in study.attacks]}


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("seeds: 4", "seeds: 0", "seeds = 0: expected a number greater than or equal to 1"),
        ("seeds: 4", "sedes: 3", "sedes = 3: no such key: did you mean seeds?"),
        ("kind: full_order", "kind: fullorder", "observers.0.kind = 'fullorder': expected one of"),
        ("scenario: gallo_six_dgu", "scenario: galo", "scenario = 'galo': galo: no such scenario"),
        ("kind: bias,", "kind: bais,", "attacks.0.kind = 'bais': expected an attack class"),
        ('link: "1-2", bias', 'link: "1-5", bias', "attacks.0.link = '1-5'"),
        ("name: stealthy", "name: bias", "attacks.1.name = 'bias': expected a name not used before among attacks"),
        ("name: stealthy", "start_sec: 1.0", "attacks.1.start_sec = 1.0: expected none"),
        ("attack_start_sec: 3.0", "attack_start_sec: 1.0", "detectors.0: settles and calibrates until 2 s"),
        ("attack_start_sec: 3.0", "attack_start_sec: 9.0", "attack_start_sec = 9: expected a time before the end"),
        ("margin: 2.0", "margn: 2.0", "detectors.0: fixed: option margn"),
        ("option: margin, values: [0.2]", "option: margin, values: [-1]", "detectors.0 with margin = -1: fixed"),
        ("set: [duration_sec=4.0", "set: [duration=4.0", "conditions.0.set: override 'duration=4.0'"),
    ],
)
def test_wrong_studies_are_refused_in_one_line(
    refuse: Callable[[str, str], Path], old: str, new: str, expected: str
) -> None:
    """The line names file, key, value and what was expected, before anything runs."""
    path = refuse(old, new)
    with pytest.raises(StudyError) as caught:
        cells_of(load_study(path), str(path), scenario_path)
    assert str(path) in str(caught.value)
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)


def test_wrong_observer_options_name_the_observer(refuse: Callable[[str, str], Path], tmp_path: Path) -> None:
    """An option that only the design can judge ends the study in one line too."""
    path = refuse("kind: full_order}", "kind: full_order, options: {strategy: none}}")
    cells = cells_of(load_study(path), str(path), scenario_path)
    with pytest.raises(StudyError, match="observer data-driven: full_order: option strategy"):
        run_study(cells, tmp_path / "out", LocalPool(1))


@pytest.mark.parametrize(
    ("observer", "expected"),
    [
        ("kind: full_order, options: {decay: 3}", "options.decay = 3: Input should be less than 1"),
        ("kind: reduced_order, options: {dcay: 0.4}", "options.dcay = 0.4: no such option: expected one of"),
        ("kind: model_based, options: {decay: x}", "options.decay = 'x': Input should be a valid number"),
        ("kind: full_order, plausibility: {estimator: {options: {x: 1}}}", "plausibility.estimator.options.x = 1: no"),
    ],
)
def test_wrong_options_are_named_before_the_first_run(
    refuse: Callable[[str, str], Path], observer: str, expected: str
) -> None:
    """File, key, value and what was expected, of observers, baselines and further tests alike."""
    path = refuse("kind: full_order", observer)
    study = load_study(path)
    with pytest.raises(StudyError) as caught:
        check_designs(study, cells_of(study, str(path), scenario_path), str(path))
    assert str(caught.value).startswith(f"{path}: observers.0.{expected}")


def test_detectors_start_before_the_first_run(refuse: Callable[[str, str], Path]) -> None:
    """Another number of levels than the observers have outputs is found by starting every detector once."""
    path = refuse("margin: 2.0", "margin: 2.0, floor: [1.0, 2.0]")
    study = load_study(path)
    with pytest.raises(StudyError) as caught:
        check_designs(study, cells_of(study, str(path), scenario_path), str(path))
    assert str(caught.value) == (
        f"{path}: detectors.0.options.floor = (1.0, 2.0): expected one number, or 3: one an output"
    )


@pytest.mark.parametrize("name", sorted(shipped_studies()))
def test_shipped_studies_are_valid(name: str) -> None:
    """Every shipped study loads, with a question, and all of its scenarios and detectors are accepted."""
    path = shipped_studies()[name]
    study = load_study(path)
    assert study.name == name
    assert study.question.endswith("?")
    cells = cells_of(study, str(path), scenario_path)
    assert {NO_ATTACK} < set(cells[0].scenarios)
    assert [one.seeds[0] for one in cells].count(study.first_seed) == len(study.conditions) * len(study.observers)


def test_every_key_is_documented() -> None:
    """docs/studies.md explains every key of a study file."""
    page = (Path(__file__).parents[3] / "docs" / "studies.md").read_text()
    for name in Study.model_fields:
        assert f"`{name}`" in page, name


def test_few_seeds_have_no_median_interval(table: pa.Table) -> None:
    """Four seeds have a median and no interval; a share has one whatever the number."""
    (point, *_) = operating_points([table])
    assert point.mean_voltage_v.value > 0.0
    assert point.mean_voltage_v.interval is None
    assert point.row()["detected_low"] == point.detected.interval.low if point.detected.interval else False


def test_too_few_seeds_are_said_with_the_number_that_would_do(table: pa.Table) -> None:
    """Three detections of four and none without the attack are no proof, and are not called unseen."""
    rows = table.to_pylist()
    for row in rows:
        if row["attack"] == "bias" and row["seed"] == 1:
            row["detected"] = False
    found = {one.attack: one for one in compare(operating_points([pa.Table.from_pylist(rows, table.schema)]), 1e-2)}
    assert found["bias"].best is None
    assert found["bias"].nobody == "too few seeds to tell (4; 20 would)"
    assert found["stealthy"].nobody.startswith("nobody sees it (")
    few = table.filter(pa.compute.less(table["seed"], 3))
    found = {one.attack: one for one in compare(operating_points([few]), 1e-2)}
    assert found["bias"].nobody == "too few seeds to tell (2; 12 would)"
