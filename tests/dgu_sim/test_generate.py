"""Generated grids: who is joined, what is drawn, what is refused."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter

from bags.watch.scenarios import load_scenario, parse_scenario
from dgu_sim.errors import ScenarioError
from dgu_sim.generate import generated
from dgu_sim.grid import Grid, Line
from dgu_sim.grid_settings import GridSettings

ADAPTER: TypeAdapter[GridSettings] = TypeAdapter(GridSettings)
SHARES = ("resistance_ohm", "inductance_h", "capacitance_f", "gains", "reference_v", "rated_current_a", "load")


def _pairs(**settings: object) -> list[tuple[int, int]]:
    return [line.between for line in generated(ADAPTER.validate_python(settings))[1]]


def test_who_is_joined() -> None:
    """Meshes are numbered row by row, a ring closes, a star has its centre at DGU 1."""
    assert _pairs(kind="mesh", rows=2, columns=3) == [(1, 2), (1, 4), (2, 3), (2, 5), (3, 6), (4, 5), (5, 6)]
    assert _pairs(kind="mesh", rows=1, columns=1) == []
    assert _pairs(kind="ring", size=4) == [(1, 2), (1, 4), (2, 3), (3, 4)]
    assert _pairs(kind="ring", size=2) == [(1, 2)]
    assert _pairs(kind="star", size=4) == [(1, 2), (1, 3), (1, 4)]


@pytest.mark.parametrize("size", [2, 3, 4, 300])
def test_random_grid_is_one_grid_of_about_that_degree(size: int) -> None:
    """Whatever is drawn, every DGU reaches every other one; no line stands twice; another seed is another grid."""
    settings = ADAPTER.validate_python({"kind": "random_geometric", "size": size, "degree": 5.0})
    dgus, lines = generated(settings)
    grid = Grid(
        dgus=tuple(one.id for one in dgus),
        parameters={one.id: one.parameters for one in dgus},
        lines=tuple(Line(between=one.between, resistance_ohm=one.resistance_ohm) for one in lines),
    )
    assert len(grid.components()) == 1
    assert len({one.between for one in lines}) == len(lines)
    if size == 300:
        assert 3.5 < 2 * len(lines) / size < 6.5
        other = settings.model_copy(update={"seed": 2})
        assert generated(other)[1] != lines


@given(st.sampled_from(SHARES), st.floats(0.01, 0.99), st.integers(0, 2**32))
def test_gain_condition_holds_for_whatever_is_drawn(name: str, share: float, seed: int) -> None:
    """Every DGU is one that its model accepts, within the stated range around the template."""
    spread = {name: share, "line_resistance_ohm": share}
    settings = ADAPTER.validate_python({"kind": "ring", "size": 20, "seed": seed, "spread": spread})
    dgus, lines = generated(settings)
    for one in dgus:
        assert one.parameters.gain_violation() is None
        margins = (1.0 - one.k1) / 3.134, (one.resistance_ohm - one.k2) / 0.363
        assert all(
            1.0 - share <= margin * (1.0 + 1e-12) and margin <= (1.0 + share) * (1.0 + 1e-12) for margin in margins
        )
    drawn = np.array([line.resistance_ohm for line in lines]) / 0.5
    assert np.all(np.abs(drawn - 1.0) <= share)
    assert len(set(drawn)) == len(lines)


def test_nothing_is_drawn_without_a_spread() -> None:
    """Then every DGU is the template, to the bit; and a spread of one parameter changes no other."""
    dgus, _ = generated(ADAPTER.validate_python({"kind": "ring", "size": 3}))
    assert {(one.k1, one.k2, one.k3, one.inductance_h) for one in dgus} == {(-2.134, -0.163, 13.553, 1.8e-3)}
    alone, both = (
        generated(ADAPTER.validate_python({"kind": "ring", "size": 3, "spread": spread}))[0]
        for spread in ({"capacitance_f": 0.1}, {"capacitance_f": 0.1, "reference_v": 0.1})
    )
    assert [one.capacitance_f for one in alone] == [one.capacitance_f for one in both]


def test_loads_are_scaled_whatever_their_kind() -> None:
    """The currents of a DGU's loads change by one factor, their times do not."""
    load = [
        {"kind": "step", "current_a": 4.0, "at_sec": 1.0},
        {"kind": "uniform", "low_a": 1.0, "high_a": 2.0, "hold_sec": 0.5},
        {"kind": "table", "time_sec": [0.0], "current_a": [5.0], "offset_a": 1.0},
    ]
    given_grid = {"kind": "ring", "size": 3, "dgu": {"load": load}, "spread": {"load": 0.5}}
    for one in generated(ADAPTER.validate_python(given_grid))[0]:
        step, uniform, table = (each.model_dump() for each in one.load)
        factor = step["current_a"] / 4.0
        assert 0.5 <= factor <= 1.5
        assert (uniform["low_a"], uniform["high_a"]) == (factor, 2.0 * factor)
        assert (table["scale"], table["offset_a"], table["current_a"]) == (factor, factor, (5.0,))
        assert (step["at_sec"], uniform["hold_sec"]) == (1.0, 0.5)


def test_resolved_scenario_keeps_the_section() -> None:
    """It reads back to the same scenario, DGUs included; another seed of the run is the same grid."""
    scenario = parse_scenario(
        "{name: ring, grid: {kind: ring, size: 5, spread: {gains: 0.2}}, secondary: {gain: 0.02}}"
    )
    text = scenario.to_yaml()
    assert "dgus:" not in text
    assert "lines:" not in text
    assert parse_scenario(text) == scenario
    assert parse_scenario(scenario.model_copy(update={"seed": 7}).to_yaml()).dgus == scenario.dgus
    fewer = scenario.model_copy(update={"lines": scenario.lines[:1]})
    assert parse_scenario(fewer.to_yaml()).links == fewer.links != scenario.links
    assert "grid:" not in fewer.to_yaml()


def test_tables_become_part_of_it(tmp_path: Path) -> None:
    """Two CSV files are a grid; what they leave out is the template's."""
    (tmp_path / "dgus.csv").write_text("number;k1;I\n2;-2,0;5\n7;-1,5;6\n9;-1,0;7\n", encoding="utf-8")
    (tmp_path / "lines.csv").write_text("first,second,resistance_ohm\n2,7,0.4\n9,7,0.6\n", encoding="utf-8")
    (tmp_path / "grid.yaml").write_text(
        "name: listed\ngrid:\n  kind: from_csv\n  dgus: {file: dgus.csv, columns: {id: number, load_a: I}}\n"
        "  lines: {file: lines.csv}\n",
        encoding="utf-8",
    )
    scenario = load_scenario(tmp_path / "grid.yaml")
    assert [(one.id, one.k1, one.nominal_load) for one in scenario.dgus] == [
        (2, -2.0, 5.0),
        (7, -1.5, 6.0),
        (9, -1.0, 7.0),
    ]
    assert [(one.between, one.resistance_ohm) for one in scenario.lines] == [((2, 7), 0.4), ((9, 7), 0.6)]
    assert parse_scenario(scenario.to_yaml()) == scenario
    (tmp_path / "lines.csv").write_text("a,b\n1,2\n", encoding="utf-8")
    with pytest.raises(ScenarioError, match=r"grid\.lines\.file = 'lines\.csv': expected the columns first, second"):
        load_scenario(tmp_path / "grid.yaml")


@pytest.mark.parametrize(
    ("grid", "said"),
    [
        ("{kind: mesch, rows: 2}", "grid.kind = 'mesch': expected one of 'mesh', 'ring'"),
        ("{kind: mesh, rows: 2}", "grid.columns: this key is missing"),
        ("{kind: mesh, rows: 2000, columns: 2000}", "grid.columns = 2000: expected at most 1000000 DGUs in all"),
        ("{kind: ring, size: 1}", "grid.size = 1: expected a number greater than or equal to 2"),
        ("{kind: ring, size: 5, spread: {gains: 1.0}}", "grid.spread.gains = 1.0: expected a number less than 1"),
        ("{kind: ring, size: 5, dgu: {k1: 2}}", "grid.dgu.k1 = 2.0: expected k1 < 1 (gain condition)"),
        (
            "{kind: ring, size: 5, dgu: {k3: 600}, spread: {gains: 0.1}}",
            "grid.spread.gains = 0.1: expected less than 0.05",
        ),
        ("{kind: ring, size: 5, line: {inductance_h: 1}}", "grid.line.inductance_h = 1.0: expected at most 0.0005"),
        (
            "{kind: from_csv, dgus: {}, lines: {first: [1], second: [2]}}",
            "grid.dgus = {}: expected at least one column",
        ),
        (
            "{kind: from_csv, dgus: {k1: [-1, 2]}, lines: {first: [1], second: [2]}}",
            "grid.dgus.k1.1 = 2.0: expected k1 < 1 (gain condition)",
        ),
        (
            "{kind: from_csv, dgus: {id: [1, 2], k1: [-1]}, lines: {first: [1], second: [2]}}",
            "grid.dgus.k1 = '1 values': expected as many as id has, 2",
        ),
        (
            "{kind: from_csv, dgus: {id: [2, 1]}, lines: {first: [1], second: [2]}}",
            "grid.dgus.id.1 = 1: expected an id above 2: ids ascend",
        ),
        (
            "{kind: from_csv, dgus: {id: [1, 2]}, lines: {first: [1], second: [3]}}",
            "grid.lines.second.0 = 3: expected the number of a DGU of the table",
        ),
    ],
)
def test_wrong_grid(grid: str, said: str) -> None:
    """One line: file, key, value, what was expected."""
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(f"{{name: wrong, grid: {grid}}}", "t.yaml")
    assert str(caught.value).startswith(f"t.yaml: {said}")
    assert "\n" not in str(caught.value)


def test_either_listed_or_generated() -> None:
    """A grid in two ways is refused."""
    with pytest.raises(ScenarioError, match="lines = \\[\\]: expected either grid, which makes them, or lines"):
        parse_scenario("{name: both, grid: {kind: ring, size: 3}, lines: []}")
