"""Runs in outline: what report and pictures are made of."""

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bags.reporting import outline as outline_module
from bags.reporting.outline import Outline, outline, outline_of
from bags.runs.reader import open_run
from bags.runs.run_record import RunRecord


def _numbers(found: Outline) -> str:
    """Everything but the window itself, to the last bit."""
    return repr([(one.name, getattr(found, one.name)) for one in fields(found) if one.name != "run"])


@settings(max_examples=12, deadline=None)  # every example reads the bag
@given(size=st.integers(1, 300))
def test_windows_do_not_matter(bag: Path, record: RunRecord, size: int) -> None:
    """Read in windows of any size, a run has the outline that it has as a whole."""
    with np.printoptions(threshold=100_000, floatmode="unique"):
        assert _numbers(outline(open_run(bag).windows(size), record.steps)) == _numbers(outline_of(record))


@pytest.mark.parametrize("points", [1, 7, 120, 239, 240, 2000])
def test_thinning_keeps_spikes(record: RunRecord, monkeypatch: pytest.MonkeyPatch, points: int) -> None:
    """A picture has no more points than asked for, ends where the run ends and never hides the largest residual."""
    monkeypatch.setattr(outline_module, "MOST_POINTS", points)
    found = outline_of(record)
    assert len(found.time_sec) == len(found.x) == min(points, 240)
    assert len(found.stretch_sec) == len(found.peaks) <= points
    assert found.time_sec[-1] == record.time_sec[-1 if points > 1 else 0]
    np.testing.assert_array_equal(np.nanmax(found.peaks, axis=0), np.nanmax(np.abs(record.residual), axis=0))
    last = found.stretch_sec[-1]
    assert last <= record.time_sec[-1] < last + (found.stretch_sec[1] if points > 1 else 3.0)
