"""The recorded runs in bags/golden: replayed, they give what they gave when they were recorded."""

from pathlib import Path

import numpy as np
import pytest

from bags.check import check
from bags.golden import GOLDEN, expected_of, golden_path, record_golden
from bags.reader import read_run
from bags.replay import replay
from bags.report import summary


@pytest.mark.parametrize("name", list(GOLDEN))
def test_replay_gives_the_expected_results(name: str) -> None:
    """Fresh monitors on a golden bag conclude what its JSON says, with the recorded residuals."""
    assert check(golden_path(name)).clean
    recorded = read_run(golden_path(name))
    again = replay(recorded)
    document, expected = summary(again).document(), expected_of(name)
    for link, wanted in zip(document["links"], expected["links"], strict=True):
        for key in ("from", "to", "attacked", "attack_start_sec", "alarm_sec", "detection_delay_sec", "false_alarms"):
            assert link[key] == wanted[key], key
        assert (link["monitored"], link["observer"]) == (wanted["monitored"], wanted["observer"])
    assert (document["scenario"], document["seed"], document["steps"]) == (name, 7, 300)
    # designs go through LAPACK, whose last bits differ between processors; residuals are of the order 1e-2
    np.testing.assert_allclose(again.residual, recorded.residual, rtol=0.0, atol=1e-9)
    assert again.alarms == recorded.alarms or np.array_equal(again.alarm, recorded.alarm)


def test_attacks_are_seen() -> None:
    """The biased run alarms on the attacked links soon after the attacks, the attack-free one on none."""
    quiet = expected_of("attack_free")["links"]
    assert not any(link["attacked"] or link["alarm_sec"] is not None for link in quiet)
    biased = [link for link in expected_of("biased")["links"] if link["attacked"]]
    assert [(link["from"], link["to"]) for link in biased] == [("dgu_3", "dgu_1"), ("dgu_1", "dgu_2")]
    assert all(0.0 <= link["detection_delay_sec"] <= 0.05 for link in biased)


def test_golden_bags_are_small() -> None:
    """No golden bag exceeds 400 kB."""
    for name in GOLDEN:
        assert sum(file.stat().st_size for file in golden_path(name).iterdir()) < 400_000


def test_recording_again(tmp_path: Path) -> None:
    """The command that makes the golden bags works, and makes the runs that are there."""
    bags = record_golden(tmp_path)
    assert [bag.name for bag in bags] == list(GOLDEN)
    for name in GOLDEN:
        again, recorded = read_run(golden_path(name, tmp_path)), read_run(golden_path(name))
        assert again.x.tobytes() == recorded.x.tobytes()
        assert again.received.tobytes() == recorded.received.tobytes()
