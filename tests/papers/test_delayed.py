"""The figures of the delayed observers on DGU 1."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from dcmg.papers import delayed
from dcmg.papers.turan_2021 import DGUS, T_S
from dgu_sim.matrices import continuous, discretise
from monitor.delayed import design, model_of
from monitor.delayed.model_based import design_from_model
from monitor.history import single

if TYPE_CHECKING:
    from pathlib import Path

    from monitor.history import History


@pytest.fixture(scope="module")
def result() -> delayed.DelayedResult:
    """The experiment."""
    return delayed.run(records=(20, 320), record_seeds=2)


def test_figures_of_the_page_come_out(result: delayed.DelayedResult) -> None:
    """Every gamma, the pole, and no bound exceeded in 10^4 random and 100 optimised runs."""
    assert not [check for check in delayed.checks(result) if not check.ok]


def test_bounds_from_data_come_close_to_those_of_the_model(result: delayed.DelayedResult) -> None:
    """With 320 samples the data-driven bound is within 10 % of the model's: sampling, 1 / sqrt(N)."""
    assert np.max(result.bound_error[-1]) < 0.1


def test_figure_is_written(result: delayed.DelayedResult, tmp_path: Path) -> None:
    """One PNG with four panels."""
    (path,) = delayed.plot(result, tmp_path / "figures")
    assert path.name == "delayed.png"
    assert path.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("delay", range(7))
def test_one_output_is_never_decoupled_exactly(delay: int) -> None:
    """V only: rank Gamma grows by one at most where two are needed, whatever the delay; the refusal says so."""
    model = model_of(*discretise(*continuous(DGUS[0]), T_S), np.eye(3)[:1])
    made = design_from_model(model, {"delay": delay, "goal": "exact"}, T_S)
    assert made.verdict.endswith(f"rank Gamma_delta - rank Gamma_delta-1 is {min(delay, 1)}, expected 2")


def test_without_delay_nothing_is_decoupled_exactly() -> None:
    """Y = x, delay 0: no output shows an unknown input before the next sample (D = 0)."""
    model = model_of(*discretise(*continuous(DGUS[0]), T_S), np.eye(3))
    made = design_from_model(model, {"delay": 0, "goal": "exact"}, T_S)
    assert made.verdict.endswith("rank Gamma_delta - rank Gamma_delta-1 is 0, expected 2")


def test_the_factor_by_which_bounds_are_approached_is_printed(result: delayed.DelayedResult) -> None:
    """One row a case; where a bound is not zero the optimised inputs come within a hundredth of it."""
    rows = [line for line in delayed.notes(result) if line.startswith("| y")]
    assert len(rows) == len(delayed.CASES)
    columns = [name.strip() for name in delayed.HEAD.split("|")]
    cells = [dict(zip(columns, row.split("|"), strict=True)) for row in rows if "exact" not in row]
    assert len(cells) == 6
    for one in cells:
        assert 0.99 < float(one["/ smaller bound"]) <= 1.0
        assert 0.95 < float(one["input error"]) / float(one["input bound"]) <= 1.0


CONDUCTANCE = (44.3, 45.0, 31.0, 54.2, 25.0, 22.5)  # sum of 1/R_ij of every DGU's lines [S] (theory.md section 1)


@pytest.mark.parametrize("number", range(6))
def test_an_attack_on_any_single_output_of_a_connected_dgu_can_be_reconstructed(number: int) -> None:
    """From history alone, next to unknown load and reference, for V, I_t and v of all six DGUs on their lines."""
    for channel in range(3):
        made = design(_history(number, CONDUCTANCE[number]), {"attacked": (channel,), "goal": "exact"})
        assert made.accepted, made.verdict


def test_an_isolated_dgu_may_hide_an_attack_behind_an_unstable_zero() -> None:
    """Isolated, DGU 4 has a zero at -17.7 from a false I_t: the attack cannot be reconstructed, and that is said."""
    made = design(_history(3, 0.0), {"attacked": (1,), "goal": "exact"})
    assert not made.accepted
    assert "17.68" in made.verdict


def _history(number: int, conductance: float) -> History:
    """Thirty samples of one DGU under random load and reference."""
    A, E = discretise(*continuous(DGUS[number], conductance), T_S)
    generator = np.random.default_rng(number)
    rows = [generator.uniform(-1.0, 1.0, 3)]
    for d in np.array([11.0, 50.0]) + generator.uniform(-1.0, 1.0, (29, 2)):
        rows.append(A @ rows[-1] + E @ d)
    x = np.array(rows)
    return single(np.empty((30, 0)), x, x, T_S)
