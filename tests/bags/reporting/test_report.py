"""The table and the JSON document of a run."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bags.reporting.report import summary
from bags.runs.run_record import RunRecord
from dgu_sim.grid import Link


def test_attacked_link_is_told_apart(record: RunRecord) -> None:
    """The attack of 0.1 on 1-2 is seen at once and leaves the other links quiet."""
    rows = {(row.source, row.target): row for row in summary(record).links}
    assert list(rows) == [("dgu_2", "dgu_1"), ("dgu_3", "dgu_1"), ("dgu_1", "dgu_2"), ("dgu_1", "dgu_3")]
    attacked = rows["dgu_1", "dgu_2"]
    assert (attacked.attacked, attacked.attack_start_sec, attacked.alarm_sec) == (True, 1.0, 1.0)
    assert attacked.detection_delay_sec == 0.0
    assert attacked.max_abs_residual_after is not None
    assert attacked.max_abs_residual_after > max(attacked.threshold) > attacked.max_abs_residual_before
    quiet = rows["dgu_2", "dgu_1"]
    assert (quiet.attacked, quiet.alarm_sec, quiet.detection_delay_sec, quiet.false_alarms) == (False, None, None, 0)
    assert quiet.max_abs_residual_after is None
    assert "accepted" in quiet.verdict


def test_document_is_plain_json(record: RunRecord, bag: Path) -> None:
    """The document holds what a program needs and nothing that JSON does not know."""
    document = json.loads(json.dumps(summary(record, bag).document(), allow_nan=False))
    assert (document["scenario"], document["seed"], document["steps"]) == ("three_dgus", 7, 240)
    assert document["bag"] == str(bag)
    link = document["links"][2]
    expected = {"from": "dgu_1", "to": "dgu_2", "attacked": True, "attack_start_sec": 1.0, "alarm_sec": 1.0}
    assert expected.items() <= link.items()
    assert link["detection_delay_sec"] == 0.0
    assert len(link["threshold"]) == 3


def test_unmonitored_link(record: RunRecord) -> None:
    """A refused design is said, and its missing numbers are null."""
    link = record.links[0]
    refused = replace(record.designs[link], accepted=False, verdict="refused: no data")
    nothing = np.full_like(record.residual, np.nan)
    silent = replace(
        record,
        designs={**record.designs, link: refused},
        residual=nothing,
        threshold=nothing,
        phase=np.zeros_like(record.phase),
        alarm=np.zeros_like(record.alarm),
    )
    row = summary(silent).links[0]
    assert (row.monitored, row.verdict) == (False, "refused: no data")
    assert json.loads(json.dumps(row.document(), allow_nan=False))["max_abs_residual_before"] is None
    missed = summary(silent).links[2]
    assert (missed.attacked, missed.alarm_sec, missed.detection_delay_sec) == (True, None, None)


def test_run_that_never_started(record: RunRecord) -> None:
    """A run without a complete step has a summary too."""
    names = ["x", "load_current", "reference", "alpha", "y", "received", "delivered"]
    names += ["phase", "alarm", "estimate", "residual", "threshold"]
    empty = replace(record, steps=0, events=(), alarms=(), **{name: getattr(record, name)[:0] for name in names})
    result = summary(empty)
    assert (result.steps, result.duration_sec) == (0, 0.0)
    assert all(row.alarm_sec is None for row in result.links)


def test_bag_without_scenario(record: RunRecord) -> None:
    """A bag that somebody else recorded has no scenario; everything that was measured is still told."""
    result = summary(replace(record, attachments={}, designs={}))
    assert (result.scenario, result.seed) == ("", None)
    assert result.links[2].verdict == "the bag holds no design"
    assert result.links[2].alarm_sec == pytest.approx(1.0)
    assert record.links[2] == Link(1, 2)
