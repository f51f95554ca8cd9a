"""Bags from before samples took their width from the run: `tests/bags/older`, golden bags of then.

Their schemas say that vectors have three components and that no sample carries known inputs; what they say counts.
"""

from pathlib import Path

import numpy as np
import pytest

from bags.mcap.bag import open_bag
from bags.mcap.check import check
from bags.runs.reader import open_run, read_run
from bags.runs.replay import replay, replay_windows
from bags.runs.replay_bag import write_replayed

OLDER = Path(__file__).parents[1] / "older"
NAMES = sorted(folder.name for folder in OLDER.iterdir())


@pytest.mark.parametrize("name", NAMES)
def test_older_bags_open_and_replay(name: str) -> None:
    """Read by their own definitions, they give on replay every residual as recorded, bit for bit."""
    assert check(OLDER / name).clean
    recorded = read_run(OLDER / name)
    assert {type_name for type_name, _ in recorded.topics.definitions} == {
        f"dcmg_msgs/msg/{kind}" for kind in ("Alarm", "Output", "Residual", "State")
    }
    assert (recorded.topics.widths[:3], recorded.u.shape[-1]) == ((3, 3, 0), 0)
    again = replay(recorded)
    for part in ("estimate", "residual", "threshold", "alarm", "phase"):
        assert getattr(again, part).tobytes() == getattr(recorded, part).tobytes(), part
    assert again.alarms == recorded.alarms


def test_topics_of_older_bags_are_arrays() -> None:
    """The public reader knows their layout, too."""
    recorded = read_run(OLDER / "biased")
    block = open_bag(OLDER / "biased").array("/dgu_1/state")
    assert block.data["x"].tobytes() == np.ascontiguousarray(recorded.x[:, 0]).tobytes()


def test_a_replayed_older_bag_is_of_its_own_kind(tmp_path: Path) -> None:
    """What is copied and what is concluded anew have one layout, and the schema says which."""
    run = open_run(OLDER / "biased")
    list(write_replayed(tmp_path / "again", replay_windows(run.windows(70)), {}))
    recorded, again = read_run(OLDER / "biased"), read_run(tmp_path / "again")
    assert again.topics.definitions == recorded.topics.definitions
    assert again.alarms == recorded.alarms
    for topic in ("/dgu_1/state", "/dgu_2/residual/dgu_1", "/dgu_2/alarms"):
        one, other = (list(open_bag(path).messages(topic)) for path in (OLDER / "biased", tmp_path / "again"))
        assert one == other, topic
