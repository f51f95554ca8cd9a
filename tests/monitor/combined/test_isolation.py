"""Who is accused, from what all tests say."""

from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from monitor.combined import Evidence, Response, explains, isolate

if TYPE_CHECKING:
    from monitor.linear import Flag

flags = st.lists(st.booleans(), min_size=3, max_size=3)


@given(residual=flags, plausibility=flags, stream=flags, local=st.booleans(), alone=flags)
def test_accused_are_those_that_some_test_names(
    residual: list[bool], plausibility: list[bool], stream: list[bool], alone: list[bool], *, local: bool
) -> None:
    """A test of one link accuses it; the own state accuses only when no other does and one link alone explains it."""
    found = isolate(Evidence(residual, plausibility, stream, local, alone))
    direct = [any(one) for one in zip(residual, plausibility, stream, strict=True)]
    tried = local and not any(direct)
    single = tried and sum(alone) == 1
    assert list(found.by_local) == [single and one for one in alone]
    assert list(found.accused) == [named or one for named, one in zip(direct, found.by_local, strict=True)]
    assert list(found.suspected) == [tried and not single and (one or not any(alone)) for one in alone]
    assert not any(accused and suspect for accused, suspect in zip(found.accused, found.suspected, strict=True))


def test_arrays_over_runs_give_what_floats_give() -> None:
    """A batch of runs is isolated as each run by itself."""
    cases = list(product([False, True], repeat=5))
    columns = [np.array(column) for column in zip(*cases, strict=True)]
    quiet: list[Flag] = [np.zeros(len(cases), dtype=np.bool_)] * 2
    together = isolate(Evidence(columns[:2], quiet, quiet, columns[2], columns[3:]))
    for run, case in enumerate(cases):
        one = isolate(Evidence(case[:2], [False] * 2, [False] * 2, case[2], case[3:]))
        for name in ("accused", "by_local", "suspected"):
            batch = [np.broadcast_to(flag, len(cases))[run] for flag in getattr(together, name)]
            assert batch == list(getattr(one, name))


def test_a_link_explains_what_its_true_reference_allows() -> None:
    """1 A over 20 S is a lie of 0.05 V: the true reference would be 0.05 V lower, and that must be plausible."""
    assert explains(1.0, 20.0, 48.05, 47.9, 48.1)
    assert not explains(1.0, 20.0, 47.92, 47.9, 48.1)
    assert not explains(1.0, 0.0, 48.0, 47.9, 48.1)  # it does not act on the own state
    assert not explains(float("nan"), 0.0, 48.0, 47.9, 48.1)
    assert explains(1.0, 20.0, float("nan"), float("nan"), float("nan"))  # nothing is known of it


def test_a_link_is_left_out_until_it_has_been_quiet() -> None:
    """Left out from the accused sample on, heard again after so many samples without an accusation."""
    response = Response(quiet_steps=3)
    state, left = response.init(1), []
    accused = [False, True, False, False, True, False, False, False, False, False]
    for flag in accused:
        state, dropped = response.step(state, [flag])
        left.append(dropped[0])
    assert left == [False, True, True, True, True, True, True, True, False, False]
