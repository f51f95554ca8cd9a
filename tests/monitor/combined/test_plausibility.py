"""What is plausible of a reconstructed input."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from monitor.combined import PlausibilityTest, build_limits
from monitor.detectors import Phase
from monitor.errors import MonitorError

T_S = 0.1
OPTIONS = {"settle_sec": 0.2, "calibrate_sec": 0.5, "margin": 0.5, "range": [1.0, 0.1], "rate": [20.0, 2.0]}


class _Echo:
    """An "estimator" whose input is the first two outputs: the limits see what the test sends."""

    inputs, outputs, lag = 2, 3, 0

    def init(self, y: object) -> tuple[float, ...]:
        """Nothing to remember but whether it waits."""
        return (0.0,) if np.isfinite(np.asarray(y, dtype=float)).all() else (math.nan,)

    def step(self, state: object, y: object) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """The input is what came."""
        del state
        values = tuple(np.asarray(y, dtype=float).tolist())
        return self.init(y), values[:2]


def _judged(inputs: list[tuple[float, float]], options: dict[str, object]) -> list[tuple[int, bool]]:
    test = PlausibilityTest(estimator=_Echo(), limits=build_limits(options, T_S), channels=(0, 1, 2))
    state, said = test.init(), []
    for current, voltage in inputs:
        state, output = test.step(state, (current, voltage, 0.0), not math.isnan(current))
        said.append((int(output.phase), bool(output.alarm)))
    return said


def test_limits_are_what_was_seen_and_what_is_known() -> None:
    """[low - m w - R, high + m w + R] and (1 + m) fastest + S, learned after settling and kept."""
    limits = build_limits(OPTIONS, T_S)
    state = limits.init()
    seen = [(99.0, 99.0), (10.0, 48.0), (10.0, 48.0), (11.0, 48.2), (10.5, 48.1), (10.0, 48.0), (10.0, 48.0)]
    for current, voltage in [*seen, (10.0, 48.0)]:
        state, judged = limits.step(state, (current, voltage))
    assert judged.lower == pytest.approx((10.0 - 0.5 - 1.0, 48.0 - 0.1 - 0.1))
    assert judged.upper == pytest.approx((11.0 + 0.5 + 1.0, 48.2 + 0.1 + 0.1))
    assert judged.rate == pytest.approx((1.5 * 10.0 + 20.0, 1.5 * 2.0 + 2.0))
    assert judged.phase == Phase.ARMED


@pytest.mark.parametrize(
    ("found", "expected"),
    [((11.4, 48.0), 0), ((11.6, 48.0), 1), ((8.4, 48.0), 1), ((10.0, 48.16), 1), ((10.0, 48.14), 0)],
)
def test_an_input_outside_its_range_is_an_alarm(found: tuple[float, float], expected: int) -> None:
    """Between 10.0 and 10.4 A and at 48 V nothing but 1 + 0.1 A, 0.1 + 0.05 V more is plausible."""
    calm = [(10.0 + 0.1 * (k % 2) * 4.0, 48.0 + 0.05 * (k % 2)) for k in range(7)]
    options = {**OPTIONS, "rate": None, "margin": 0.0}
    assert _judged([*calm, found], options)[-1] == (Phase.ARMED, bool(expected))


def test_a_change_that_is_too_fast_is_an_alarm() -> None:
    """Within the range, 3 A/s is plausible and 30 A/s is not when loads are known to change by 20 A/s at most."""
    calm = [(10.0, 48.0)] * 8
    assert not _judged([*calm, (10.3, 48.0)], {**OPTIONS, "range": [5.0, 1.0]})[-1][1]
    assert _judged([*calm, (13.0, 48.0)], {**OPTIONS, "range": [5.0, 1.0]})[-1][1]
    assert not _judged([*calm, (13.0, 48.0)], {**OPTIONS, "range": [5.0, 1.0], "rate": None})[-1][1]


def test_a_missing_sample_settles_again_but_forgets_nothing() -> None:
    """After a gap there is no verdict for the settling time, then the old limits hold."""
    calm, gap = [(10.0, 48.0)] * 8, [(math.nan, math.nan)] * 2
    said = _judged([*calm, *gap, *calm, (20.0, 48.0)], OPTIONS)
    assert [phase for phase, _ in said[7:13]] == [3, 1, 1, 1, 1, 3]
    assert said[-1] == (3, True)
    assert not any(alarm for _, alarm in said[:-1])


@settings(max_examples=30, deadline=None)
@given(
    walk=st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(-0.1, 0.1)), min_size=10, max_size=40),
)
def test_the_promise_is_kept(walk: list[tuple[float, float]]) -> None:
    """While inputs stay within the known range of what the attack-free stretch showed there is no alarm at all."""
    inputs = [(10.0, 48.0)] * 7 + [(10.0 + current, 48.0 + voltage) for current, voltage in walk]
    options = {**OPTIONS, "rate": None, "margin": 0.0, "range": [1.0 + 1e-9, 0.1 + 1e-9]}
    assert not any(alarm for _, alarm in _judged(inputs, options))
    assert "no false alarm while the inputs stay within" in build_limits(options, T_S).promise


def test_refused_stays_refused() -> None:
    """Without an estimator nothing is ever said."""
    test = PlausibilityTest(estimator=None, limits=build_limits({}, T_S), channels=())
    _, output = test.step(test.init(), (1.0, 2.0, 3.0), delivered=True)
    assert (output.phase, output.alarm, test.lag) == (Phase.REFUSED, False, 0)
    assert np.isnan(np.array(output.input)).all()


@pytest.mark.parametrize(
    "options", [{"range": [1.0]}, {"range": [-1.0, 0.1]}, {"rate": [1.0, -1.0]}, {"width": 3}, {"calibrate_sec": 0}]
)
def test_wrong_options_are_misuse(options: dict[str, object]) -> None:
    """One line that names the option."""
    with pytest.raises(MonitorError, match=f"plausibility: option {next(iter(options))}"):
        build_limits(options, T_S)
