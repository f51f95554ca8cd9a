"""Streams with every fault there is, told when it appears and when it is over."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor.stream_guard import Arrival, StreamFault, StreamGuard

GUARD = StreamGuard(2)


def kinds(*arrivals: Arrival, k: int = 7) -> set[str]:
    """Faults of one step after a stream in order."""
    return {change.kind.value for change in GUARD.step(GUARD.init(), k, arrivals)[1]}


@given(st.integers(1, 50))
def test_a_stream_in_order_is_never_accused(steps: int) -> None:
    """One message of each step from the known publisher: no change, ever."""
    state = GUARD.init()
    for k in range(steps):
        state, changes = GUARD.step(state, k, [Arrival(step=k, source=2)])
        assert changes == ()
    assert state == ()


@pytest.mark.parametrize(
    ("arrivals", "expected"),
    [
        ([Arrival(7, 2), Arrival(7, 2, known=False)], {"second_publisher"}),
        ([Arrival(7, 2, known=False), Arrival(7, 2)], {"second_publisher"}),
        ([Arrival(7, 2), Arrival(3, 9, known=False)], {"second_publisher"}),
        ([Arrival(7, 3)], {"wrong_source"}),
        ([Arrival(7, 2), Arrival(7, 2)], {"repeated"}),
        ([Arrival(7, 2), Arrival(6, 2)], {"repeated"}),
        ([Arrival(6, 2)], {"missing", "repeated"}),
        ([], {"missing"}),
        ([Arrival(7, 2, delivered=False)], {"missing"}),
        ([Arrival(4, 2)], {"missing", "out_of_order"}),
        ([Arrival(8, 2)], {"missing", "out_of_order"}),
        ([Arrival(8, 2), Arrival(7, 2)], {"out_of_order"}),
    ],
)
def test_every_fault_is_told_by_its_name(arrivals: list[Arrival], expected: set[str]) -> None:
    """Each of the five, and what comes together."""
    assert kinds(*arrivals) == expected


def test_a_fault_is_told_when_it_appears_and_when_it_is_over() -> None:
    """Ten spoofed steps are two changes, with words."""
    state, told = GUARD.init(), []
    for k in range(30):
        arrivals = [Arrival(k, 2), *([Arrival(k, 2, known=False)] if 10 <= k < 20 else [])]
        state, changes = GUARD.step(state, k, arrivals)
        told += [(k, change.kind, change.active, change.detail) for change in changes]
    assert told == [
        (10, StreamFault.SECOND_PUBLISHER, True, "a publisher unknown at step 0 sent step 10 of dgu_2"),
        (20, StreamFault.SECOND_PUBLISHER, False, "in order again"),
    ]
