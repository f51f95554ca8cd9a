"""When the messages of a replay are due."""

from __future__ import annotations

from math import inf

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dcmg_nodes.errors import NodeError
from dcmg_nodes.pace import Pace
from dcmg_nodes.punctuality import Punctuality

_MS = 1_000_000


@given(rate=st.floats(0.01, 100.0), start=st.floats(0.0, 1e6), step=st.integers(0, 10**12))
def test_due_times_follow_the_rate(rate: float, start: float, step: int) -> None:
    """A stamp t is due (t - t0) / rate after the start."""
    pace = Pace(rate, paused=False)
    pace.start(start, 5)
    assert pace.due_sec(5 + step) - start == pytest.approx(step * 1e-9 / rate, abs=1e-6)


def test_a_change_of_rate_keeps_the_position() -> None:
    """Half a second at rate 1 and from then on at rate 2: the stamp at 1 s is due 0.25 s after the change."""
    pace = Pace(1.0, paused=False)
    pace.start(100.0, 0)
    pace.set_rate(100.5, 2.0)
    assert pace.due_sec(1000 * _MS) == pytest.approx(100.75)


def test_pause_and_resume() -> None:
    """While paused nothing is due; what was due in 0.3 s is due 0.3 s after going on."""
    pace = Pace(1.0, paused=False)
    pace.start(0.0, 0)
    pace.pause(0.7)
    assert pace.due_sec(1000 * _MS) == inf
    pace.resume(50.0)
    assert pace.due_sec(1000 * _MS) == pytest.approx(50.3)


def test_steps_while_paused() -> None:
    """Two steps, told one by one, let two stamps out; then it stands still, and goes on from there."""
    pace = Pace(1.0, paused=True)
    pace.start(0.0, 0)
    assert pace.due_sec(0) == inf
    pace.step(1.0)
    pace.step(1.0)
    for stamp in (0, 10 * _MS):
        assert pace.due_sec(stamp) == -inf
        pace.passed(1.0, stamp)
    assert pace.due_sec(20 * _MS) == inf
    pace.resume(9.0)
    assert pace.due_sec(20 * _MS) == pytest.approx(9.01)


def test_unlimited() -> None:
    """As fast as the machine goes, everything is due; a rate set later starts from where it is."""
    pace = Pace(inf, paused=False)
    pace.start(0.0, 0)
    assert pace.due_sec(10**15) == -inf
    pace.passed(2.0, 500 * _MS)
    pace.set_rate(3.0, 1.0)
    assert pace.due_sec(600 * _MS) == pytest.approx(3.1)


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan")])
def test_impossible_rates(rate: float) -> None:
    """A rate is positive, at the start and later."""
    with pytest.raises(NodeError, match="expected a positive number"):
        Pace(rate, paused=False)
    with pytest.raises(NodeError, match="expected a positive number"):
        Pace(1.0, paused=False).set_rate(0.0, rate)


@settings(max_examples=20)  # each walks through 100,000 bins
@given(st.lists(st.floats(-0.9, 0.9), min_size=1))
def test_quantiles_of_the_errors(errors: list[float]) -> None:
    """A quantile bounds its share of the errors' sizes, and is met to one bin by one of them."""
    punctuality = Punctuality()
    for error in errors:
        punctuality.add(error)
    sizes = sorted(map(abs, errors))
    assert punctuality.worst_sec == sizes[-1]
    for share in (0.5, 0.99, 1.0):
        bound = punctuality.quantile_sec(share)
        assert sum(size <= bound for size in sizes) >= share * len(sizes)
        assert any(bound - 1.001e-5 <= size <= bound for size in sizes)
