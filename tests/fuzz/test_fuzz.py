"""A short, always equal slice of `make fuzz`, what it once found, and whether its judge can be trusted."""

from __future__ import annotations

import pytest

from tests.fuzz.counter_examples import MENDED, OPEN
from tests.fuzz.trials import TRIALS, judged

_SLICE = 3  # rounds


@pytest.mark.parametrize("kind", TRIALS)
def test_no_design_breaks_its_promise(kind: str) -> None:
    """The first cases of every kind are accepted and right, or refused for a true reason, whatever the units."""
    results = [judged(kind, seed) for seed in range(_SLICE * TRIALS[kind].share)]
    assert not [one for one in results if one.outcome.bad and (one.kind, one.seed) not in OPEN]


@pytest.mark.parametrize(("kind", "seed"), MENDED)
def test_what_was_found_stays_mended(kind: str, seed: int) -> None:
    """Every counter-example ever found."""
    result = judged(kind, seed)
    assert not result.outcome.bad, result.detail
