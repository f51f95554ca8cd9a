"""Histories: what is stacked, what is dropped, what is refused and how."""

from __future__ import annotations

import numpy as np
import pytest

from monitor.errors import HistoryError
from monitor.history import Experiment, History, data_matrices, single


def _tables(samples: int = 12, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    generator = np.random.default_rng(seed)
    return tuple(generator.standard_normal((samples, columns)) for columns in (1, 2, 3))  # type: ignore[return-value]


def test_columns_pair_consecutive_samples_within_an_experiment() -> None:
    """Past and future columns are one step apart, and no column bridges two experiments."""
    first, second = _tables(8, 1), _tables(6, 2)
    data = data_matrices(History((Experiment(*first), Experiment(*second)), 0.01))
    assert data.columns == 7 + 5
    assert np.array_equal(data.X_p, np.vstack([first[2][:-1], second[2][:-1]]).T)
    assert np.array_equal(data.X_f, np.vstack([first[2][1:], second[2][1:]]).T)
    assert np.array_equal(data.U_f, np.vstack([first[0][1:], second[0][1:]]).T)
    assert data.positions.tolist() == [*range(7), *range(8, 13)]


def test_columns_with_a_gap_are_dropped() -> None:
    """A missing value costs the two columns it appears in and nothing else."""
    u, y, x = _tables()
    y[4, 1] = np.nan
    data = data_matrices(single(u, y, x, 0.01))
    assert (data.columns, data.dropped) == (9, 2)
    assert np.isfinite(data.Y_p).all()


def test_a_history_of_gaps_is_refused() -> None:
    """With every column lost the line says so and asks for more."""
    u, y, x = _tables()
    x[::2] = np.nan
    with pytest.raises(HistoryError, match=r"0 pairs of consecutive samples .11 more hold NaN.*record longer"):
        data_matrices(single(u, y, x, 0.01))


def test_too_short() -> None:
    """Fewer columns than the data span with one unknown input."""
    u, y, x = _tables(6)
    with pytest.raises(HistoryError, match=r"5 pairs .* expected at least 6 for 3 states and 1 known inputs"):
        data_matrices(single(u, y, x, 0.01))


def test_constant_signal() -> None:
    """The signal that never moves is named."""
    u, y, x = _tables()
    x[:, 1] = 4.0
    with pytest.raises(HistoryError, match=r"x\[1\] is constant at 4 .*excite it"):
        data_matrices(single(u, y, x, 0.01))


def test_wrong_shapes() -> None:
    """Tables of another length or dimension are named with what was expected."""
    u, y, x = _tables()
    with pytest.raises(HistoryError, match="12, 12, 11 samples, expected the same number"):
        Experiment(u, y, x[:-1])
    with pytest.raises(HistoryError, match=r"x has shape \(12,\), expected \(samples, columns\)"):
        Experiment(u, y, x[:, 0])


def test_experiments_of_different_signals() -> None:
    """The experiment that does not fit is named."""
    u, y, x = _tables()
    with pytest.raises(HistoryError, match=r"experiment 1 has 1 columns in y, experiment 0 has 2"):
        History((Experiment(u, y, x), Experiment(u, y[:, :1], x)), 0.01)


def test_mixed_sampling_periods() -> None:
    """An experiment sampled at another rate is named with both periods."""
    u, y, x = _tables()
    with pytest.raises(HistoryError, match=r"experiment 1 is sampled every 0.02 s, the history every 0.01 s"):
        History((Experiment(u, y, x, 0.01), Experiment(u, y, x, 0.02)), 0.01)


def test_empty_history_and_period() -> None:
    """No experiment and no positive period are refused."""
    with pytest.raises(HistoryError, match=r"no experiment"):
        History((), 0.01)
    with pytest.raises(HistoryError, match=r"sampling period is 0.0 s"):
        single(*_tables(), 0.0)
