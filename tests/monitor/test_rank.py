"""The rank decision: right, or refused in words; never a silent guess."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from monitor.errors import HistoryError
from monitor.history import History, data_matrices, single
from monitor.rank import RankBasis, RankOptions, decide_rank

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.monitor.conftest import Plant

DGUS = range(1, 7)


@pytest.mark.parametrize("number", DGUS)
def test_exact_data_show_both_unknown_inputs(dgu_history: Callable[..., History], number: int) -> None:
    """Without noise the two unknown inputs of every DGU are counted without being told."""
    decision = decide_rank(data_matrices(dgu_history(number)), RankOptions())
    assert (decision.unknown_inputs, decision.basis) == (2, RankBasis.EXACT)


@pytest.mark.parametrize("number", DGUS)
def test_float32_leaves_a_clear_gap(dgu_history: Callable[..., History], number: int) -> None:
    """Rounding to float32 lifts the zero singular value; the gap still tells, with a confidence."""
    x = dgu_history(number).experiments[0].x.astype(np.float32).astype(float)
    decision = decide_rank(data_matrices(single(np.zeros((20, 0)), x, x, 0.01)), RankOptions())
    assert (decision.unknown_inputs, decision.basis) == (2, RankBasis.GAP)
    assert decision.confidence > 0.9


@pytest.mark.parametrize("number", DGUS)
@pytest.mark.parametrize("seed", range(5))
def test_noise_without_knowledge_is_right_or_refused(
    dgu_history: Callable[..., History], number: int, seed: int
) -> None:
    """With noise 1e-3 and nothing known the gap alone is never a wrong answer."""
    decision = decide_rank(data_matrices(dgu_history(number, seed, noise_std=1e-3)), RankOptions())
    assert decision.unknown_inputs in (None, 2)
    if decision.unknown_inputs is None:
        assert "give unknown_inputs or noise_std" in decision.reason


@pytest.mark.parametrize("number", DGUS)
@pytest.mark.parametrize("seed", range(5))
def test_noise_level_settles_it(dgu_history: Callable[..., History], number: int, seed: int) -> None:
    """With noise 1e-3 and its level given the rank is right."""
    data = data_matrices(dgu_history(number, seed, noise_std=1e-3))
    assert decide_rank(data, RankOptions(noise_std=1e-3)).unknown_inputs == 2


def test_overstated_noise_level_is_contradicted(dgu_history: Callable[..., History]) -> None:
    """A level a hundred times too high would swallow an unknown input: refused."""
    decision = decide_rank(data_matrices(dgu_history(1, samples=400, noise_std=1e-4)), RankOptions(noise_std=1e-2))
    assert decision.unknown_inputs is None
    assert "times what the history shows" in decision.reason


def test_known_number_needs_its_gap(dgu_history: Callable[..., History]) -> None:
    """Known m_d = 2 under noise that buries the second input is refused, not believed."""
    decision = decide_rank(data_matrices(dgu_history(1, samples=400, noise_std=0.1)), RankOptions(unknown_inputs=2))
    assert decision.unknown_inputs is None
    assert decision.reason.startswith("too noisy for 2 unknown inputs")


def test_unexcited_unknown_input_is_noticed(dgu: Callable[[int], Plant]) -> None:
    """When the reference never moves, exact data show one of the two inputs known to exist."""
    plant = dgu(1)
    generator = np.random.default_rng(0)
    d = np.column_stack([generator.uniform(-1.0, 1.0, 30), np.zeros(30)])
    y, x = plant.run(generator.uniform(-1.0, 1.0, 3), np.zeros((30, 0)), d)
    decision = decide_rank(data_matrices(single(np.zeros((30, 0)), y, x, 0.01)), RankOptions(unknown_inputs=2))
    assert decision.unknown_inputs is None
    assert "unknown_inputs is 2, but exact data show 1: not exciting" in decision.reason


def test_states_that_move_together_are_not_exciting() -> None:
    """Two proportional states cannot be told apart whatever the unknown inputs do."""
    generator = np.random.default_rng(0)
    x = generator.standard_normal((30, 3))
    x[:, 2] = 2.0 * x[:, 1]
    with pytest.raises(HistoryError, match="rank 2, expected 3"):
        decide_rank(data_matrices(single(np.zeros((30, 0)), x, x, 0.01)), RankOptions())


def test_too_small_a_number_is_contradicted_by_exact_data(dgu_history: Callable[..., History]) -> None:
    """Told of one unknown input while the data show two: a design would alarm on the other one."""
    decision = decide_rank(data_matrices(dgu_history(1)), RankOptions(unknown_inputs=1))
    assert decision.unknown_inputs is None
    assert "give the right number" in decision.reason
