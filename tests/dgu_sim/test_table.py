"""Measured curves from CSV files, whatever program wrote them: as loads, and as what an attacker adds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dcmg.attack_words import parse_order
from dcmg.errors import CommandError
from dgu_sim.errors import ScenarioError
from dgu_sim.loads import TableLoad
from dgu_sim.plausible import concerns
from dgu_sim.scenario import Scenario, load_scenario
from dgu_sim.signals import RandomSource
from dgu_sim.simulate import simulate

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from numpy.typing import NDArray

T_S = 0.01
SOURCE = RandomSource(seed=1, stream=1, dgu=1)
MEASURED = {
    "plain": ("time_sec,current_a\n0,1\n0.02,3\n0.04,2\n", "{}"),
    "byte-order mark": ("\ufefftime_sec,current_a\n0,1\n0.02,3\n0.04,2\n", "{}"),
    "more columns": ("note,current_a,V,time_sec\nx,1,48,0\n,3,48,0.02\nz,2,48,0.04\n", "{}"),
    "decimal comma": ("time_sec;current_a\n0;1\n0,02;3\n0,04;2\n", "{}"),
    "tabulators, comments, empty lines": (
        "# logger 7\n\ntime_sec\tcurrent_a\n0\t1\n\n0.02\t3\n# pause\n0.04\t2\n\n",
        "{}",
    ),
    "windows": ("time_sec,current_a\r\n0,1\r\n0.02,3\r\n0.04,2\r\n", "{}"),
    "other names and units": (
        "t_ms,I (mA)\n0,1000\n20,3000\n40,2000\n",
        '{time_sec: "t_ms*0.001", current_a: "I (mA)*1e-3"}',
    ),
    "a name with a star": ("t*,i\n0,1\n0.02,3\n0.04,2\n", '{time_sec: "t*", current_a: i}'),
    "quoted": ('"time_sec","current_a"\n"0","1"\n"0.02","3"\n"0.04","2"\n', "{}"),
}


def _current(rows: Mapping[str, object], count: int, first: int = 0, **settings: object) -> NDArray[np.float64]:
    return TableLoad.model_validate({"kind": "table", **rows, **settings}).current(first, count, T_S, SOURCE)


@pytest.mark.parametrize("name", MEASURED)
def test_a_file_is_read_whatever_wrote_it(shipped: Callable[..., Scenario], tmp_path: Path, name: str) -> None:
    """The same three rows in every dialect are the same load; the resolved scenario needs the file no more."""
    text, columns = MEASURED[name]
    (tmp_path / "load.csv").write_bytes(text.encode("utf-8"))
    (tmp_path / "mine.yaml").write_text(shipped("gallo_six_dgu").to_yaml(), encoding="utf-8")
    found = load_scenario(
        tmp_path / "mine.yaml", [f"dgus.1.load=[{{kind: table, file: load.csv, columns: {columns}}}]"]
    )
    load = found.dgu(2).load[0]
    np.testing.assert_allclose(load.current(0, 6, T_S, SOURCE), [1, 1, 3, 3, 2, 2], rtol=1e-15)
    assert "load.csv" not in found.to_yaml()


def test_a_file_is_found_where_one_works(
    shipped: Callable[..., Scenario], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A shipped scenario takes a table of the working folder, or of any path."""
    (tmp_path / "load.csv").write_text("time_sec,current_a\n0,7\n")
    monkeypatch.chdir(tmp_path)
    for file in ("load.csv", str(tmp_path / "load.csv")):
        assert shipped("gallo_six_dgu", f"dgus.1.load=[{{kind: table, file: {file}}}]").dgu(2).load[0].nominal() == 7.0


def test_start_offset_scale() -> None:
    """A log that starts anywhere is taken from any of its times on; before its first row the first one holds."""
    rows = {"time_sec": [100.0, 100.02, 100.04], "current_a": [1.0, 3.0, 2.0]}
    assert _current(rows, 6).tolist() == [1.0] * 6
    assert _current(rows, 6, from_sec=100.0).tolist() == [1.0, 1.0, 3.0, 3.0, 2.0, 2.0]
    assert _current(rows, 4, from_sec=100.01).tolist() == [1.0, 3.0, 3.0, 2.0]
    assert _current(rows, 4, from_sec=99.99).tolist() == [1.0, 1.0, 1.0, 3.0]
    assert _current(rows, 3, from_sec=100.01, scale=2.0, offset_a=-0.5).tolist() == [1.5, 5.5, 5.5]


def test_repetition_and_straight_lines() -> None:
    """The last row holds as long as the one before it; then the first comes again, and lines lead there."""
    rows = {"time_sec": [5.0, 5.02, 5.04], "current_a": [1.0, 3.0, 2.0], "from_sec": 5.0}
    assert _current(rows, 12, repeat=True).tolist() == [1, 1, 3, 3, 2, 2] * 2
    np.testing.assert_allclose(_current(rows, 7, interpolation="linear"), [1, 2, 3, 2.5, 2, 2, 2])
    np.testing.assert_allclose(_current(rows, 8, interpolation="linear", repeat=True), [1, 2, 3, 2.5, 2, 1.5, 1, 2])


@given(
    gaps=st.lists(st.floats(0.003, 0.2), min_size=2, max_size=12),
    first=st.integers(0, 5000),
    linear=st.booleans(),
    repeat=st.booleans(),
)
def test_a_table_is_a_function_of_the_step(gaps: list[float], first: int, linear: bool, repeat: bool) -> None:  # noqa: FBT001 (drawn)
    """In blocks or one by one the same bits; and, held against numpy, the same curve."""
    times = np.cumsum(gaps)
    values = np.sin(times * 7.0)
    settings = {
        "time_sec": times.tolist(),
        "current_a": values.tolist(),
        "from_sec": float(times[0]),
        "interpolation": "linear" if linear else "hold",
        "repeat": repeat,
    }
    whole = _current(settings, 40, first)
    assert whole.tolist() == [_current(settings, 1, first + at)[0] for at in range(40)]
    if linear:
        period = 2.0 * times[-1] - times[-2] - times[0]
        t = (first + np.arange(40)) * T_S
        told = np.interp(
            np.mod(t, period) if repeat else t,
            np.append(times - times[0], period),
            np.append(values, values[0 if repeat else -1]),
        )
        np.testing.assert_allclose(whole, told, atol=1e-6)  # at a jump of the modulus, by rounding of the time


def test_a_clock_of_another_day_is_noticed(shipped: Callable[..., Scenario]) -> None:
    """A table that begins after the end of the run is valid, and hardly meant."""
    found = shipped("gallo_six_dgu", "dgus.1.load=[{kind: table, time_sec: [1.7e9, 1700000001], current_a: [1, 2]}]")
    assert [one.text for one in concerns(found)] == [
        "dgus.1.load.0.time_sec.0 = 1.7e+09: the run ends at 10 s: its first row holds all the time; from_sec shifts it"
    ]


def test_an_attack_follows_a_file(
    shipped: Callable[..., Scenario], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same curve by scenario, by a second publisher's falsification and by hand; what has no column stays."""
    (tmp_path / "curve.csv").write_text("s;i\n0;0\n0,5;1\n1;0\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    file = 'file: curve.csv, columns: {time_sec: s, current_a: "i*0.5"}, interpolation: linear, repeat: true'
    attack = f"{{kind: bias_waveform, link: 1-2, start_sec: 3, {file}}}"
    found = shipped("gallo_six_dgu", "duration_sec=6", f"attacks=[{attack}]")
    (block,) = simulate(found)
    link = next(at for at, one in enumerate(found.links) if str(one) == "1-2")
    phi = block.received[:, 0, link, :] - block.y[:, 0, 0, :]
    t = np.arange(len(phi)) * T_S - 3.0
    expected = np.where(t < -1e-9, 0.0, np.interp(np.mod(t + 1e-9, 1.5), [0, 0.5, 1, 1.5], [0, 0.5, 0, 0]))
    np.testing.assert_allclose(phi[:, 1], expected, atol=1e-7)
    np.testing.assert_array_equal(phi[:, [0, 2]], 0.0)
    columns = '{time_sec: s, current_a: "i*0.5"}'
    order = parse_order(["bias_waveform", "1-2", "--file", "curve.csv", "--columns", columns])
    assert order.parameters["current_a"] == [0.0, 0.5, 0.0]
    falsify = f"falsify: {{kind: bias_waveform, {file}}}"
    spoofed = shipped("gallo_six_dgu", f"attacks=[{{kind: spoof, link: 1-2, start_sec: 3, {falsify}}}]")
    assert spoofed.attacks[0].parameters["falsify"]["current_a"] == [0.0, 0.5, 0.0]  # type: ignore[index]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("file: none.csv", "attacks.0.file = 'none.csv': expected a readable CSV file"),
        ("file: 3", "attacks.0.file = 3: expected the name of a CSV file"),
        ("file: curve.csv, columns: {volts: a}", "columns.volts: expected one of time_sec, voltage_v"),
        ("file: curve.csv, columns: [a]", "columns = ['a']: expected NAME or NAME*FACTOR"),
        ("file: curve.csv, columns: {current_a: x}", "expected a column x, found 'time_sec,current_a'"),
        ("file: curve.csv, columns: {current_a: current_a*two}", "expected a number behind the *"),
        ("file: curve.csv, time_sec: [0]", "expected either a file or time_sec, found both"),
        ("time_sec: [0, 1], current_a: [1]", "current_a = '1 values': expected 2, as many as time_sec"),
        ("time_sec: [0]", "expected at least one of voltage_v, current_a, integral_vs"),
        ("time_sec: [0], current_a: [1], repeat: true", "repeat = true: expected false"),
    ],
)
def test_wrong_curves_are_refused_in_one_line(
    shipped: Callable[..., Scenario], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: str, said: str
) -> None:
    """File, column and key are named."""
    (tmp_path / "curve.csv").write_text("time_sec,current_a\n0,1\n1,2\n")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ScenarioError) as caught:
        shipped("gallo_six_dgu", f"attacks=[{{kind: bias_waveform, link: 1-2, start_sec: 3, {words}}}]")
    assert said.lower() in str(caught.value).lower()
    assert "\n" not in str(caught.value)


def test_by_hand_a_file_that_is_not_there_is_named() -> None:
    """Before anything is sent."""
    with pytest.raises(CommandError, match=r"bias_waveform attack: file = 'none\.csv': expected a readable CSV file"):
        parse_order(["bias_waveform", "1-2", "--file", "none.csv"])
