"""One row a sampling period, from messages that come when they come."""

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bags.foreign.sampling import Policy, Row, Sampler, SamplerState

T = 1000


def _sampler(policy: Policy, tracks: int = 1, max_gap: int = 1500) -> Sampler:
    return Sampler(tracks=tracks, period_ns=T, policy=policy, tolerance_ns=10, max_gap_ns=max_gap)


def _run(sampler: Sampler, *tracks: list[tuple[int, float]], start: int = 0) -> tuple[list[float | None], SamplerState]:
    """First value of every row from the first track, all told in the order of their stamps."""
    rows, state = _rows(sampler, *tracks, start=start)
    return [None if row.values[0] is None else row.values[0][0] for row in rows], state


def _rows(sampler: Sampler, *tracks: list[tuple[int, float]], start: int = 0) -> tuple[list[Row], SamplerState]:
    told = sorted((stamp, number, value) for number, track in enumerate(tracks) for stamp, value in track)
    found: list[Row] = []
    state = sampler.init(start)
    for stamp, number, value in told:
        state, rows = sampler.push(state, number, stamp, (value,))
        found += rows
    state, rows = sampler.advance(state, told[-1][0] + 3 * T)
    return [*found, *rows], state


def test_refuse_takes_what_is_at_its_instant_and_counts_the_rest() -> None:
    """Within the tolerance a message is the sample; beside it it is counted; what is missing is missing."""
    values, state = _run(_sampler(Policy.REFUSE), [(0, 0.0), (1005, 1.0), (2400, 9.0), (3005, 3.0), (5005, 5.0)])
    assert values[:6] == [0.0, 1.0, None, 3.0, None, 5.0]
    assert state.irregular == 1
    assert state.example is not None
    assert (state.example.stamp_ns, state.example.off_ns) == (2400, 395)


def test_refuse_follows_clocks_that_drift_and_starts_anew_behind_a_gap() -> None:
    """Half a period of drift loses nothing; behind a gap the first message sets the grid."""
    drifting = [(k * (T + 5), float(k)) for k in range(150)]
    values, state = _run(_sampler(Policy.REFUSE), drifting)
    assert values[:150] == [value for _, value in drifting]
    shifted = [(0, 0.0), (T, 1.0), (4 * T + 300, 4.0), (5 * T + 300, 5.0)]
    values, state = _run(_sampler(Policy.REFUSE), shifted)
    assert values[:6] == [0.0, 1.0, None, None, 4.0, 5.0]
    assert state.irregular == 0


def test_nearest_takes_the_nearest_and_follows_slowly() -> None:
    """Of a fast source the nearest message counts, and a drifting one is followed."""
    fast = [(k * 300, float(k * 300)) for k in range(20)]
    rows, _ = _rows(_sampler(Policy.NEAREST), fast)
    for row in rows[:5]:
        assert row.values[0] is not None
        assert abs(row.values[0][0] - row.instant_ns) == min(abs(stamp - row.instant_ns) for stamp, _ in fast)
    drifting = [(k * (T + 5), float(k)) for k in range(1000)]
    values, _ = _run(_sampler(Policy.NEAREST), drifting)
    assert values[:1000] == [value for _, value in drifting]


def test_hold_holds_no_longer_than_told() -> None:
    """The last value stands until it is too old."""
    values, _ = _run(_sampler(Policy.HOLD, max_gap=2500), [(0, 1.0), (5 * T, 2.0)])
    assert values[:6] == [1.0, 1.0, 1.0, None, None, 2.0]


def test_linear_is_exact_on_straight_lines() -> None:
    """Whatever the stamps, a straight line stays one; a long gap is not bridged."""
    values, _ = _run(_sampler(Policy.LINEAR), [(stamp, 2.0 * stamp) for stamp in (-300, 700, 1400, 2600, 6000)])
    assert values[:3] == [0.0, 2000.0, 4000.0]
    assert values[3:6] == [None, None, None]


def test_repeated_and_late_messages_are_dropped_and_counted() -> None:
    """A stamp counts once; a message from before the last one is late."""
    sampler = _sampler(Policy.LINEAR)
    state = sampler.init(0)
    for stamp in (0, 700, 700, 200):
        state, _ = sampler.push(state, 0, stamp, (1.0,))
    assert (state.repeated, state.late) == (1, 1)


@pytest.mark.parametrize("policy", Policy)
@settings(deadline=None)  # the machine may be busy
@given(
    gaps=st.lists(st.integers(1, 2500), min_size=1, max_size=25),
    others=st.lists(st.integers(1, 2500), min_size=1, max_size=25),
    told=st.lists(st.booleans(), min_size=60, max_size=60),
)
def test_rows_depend_on_the_messages_alone(
    policy: Policy, gaps: list[int], others: list[int], told: list[bool]
) -> None:
    """Whether somebody says how far time has come or not, the rows are the same: live is as recorded."""
    tracks = [[(sum(steps[:k]), float(k)) for k in range(len(steps))] for steps in (gaps, others)]
    sampler = _sampler(policy, tracks=2)
    silent, _ = _rows(sampler, *tracks)
    messages = sorted((stamp, number, value) for number, track in enumerate(tracks) for stamp, value in track)
    state = sampler.init(0)
    spoken: list[Row] = []
    for (stamp, number, value), say in zip(messages, told, strict=False):
        state, rows = sampler.push(state, number, stamp, (value,))
        spoken += rows
        if say:
            state, rows = sampler.advance(state, stamp)
            spoken += rows
    state, rows = sampler.advance(state, messages[-1][0] + 3 * T)
    assert [*spoken, *rows] == silent
    assert all(abs(after.instant_ns - before.instant_ns - T) <= T // 2 for before, after in pairwise(silent))


@settings(deadline=None)  # the machine may be busy
@given(stamps=st.lists(st.integers(0, 10**5), min_size=2, max_size=30, unique=True))
def test_no_value_is_invented(stamps: list[int]) -> None:
    """Refuse, nearest and hold give values that somebody sent, refuse and nearest each at most once."""
    track = [(stamp, float(stamp)) for stamp in sorted(stamps)]
    for policy in (Policy.REFUSE, Policy.NEAREST, Policy.HOLD):
        values, _ = _run(_sampler(policy), track, start=track[0][0])
        sent = [value for value in values if value is not None]
        assert set(sent) <= {value for _, value in track}
        if policy is not Policy.HOLD:
            assert len(sent) == len(set(sent))
