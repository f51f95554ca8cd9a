"""Bags from which topics of a run were left out: what needs them says so, the rest reads them."""

from pathlib import Path

import pytest

from bags.mcap.errors import BagError
from bags.mcap.recording import Recording, TopicFilter
from bags.mcap.topic import TopicKind
from bags.runs.offline import simulate_to_bag
from bags.runs.reader import read_run
from bags.runs.replay import replay
from bags.watch.scenarios import load_scenario
from bags.wire import table
from bags.wire.schema import topics_of
from dcmg.shipped import scenario_path

_COMBINED, _TEAM = "gallo_six_dgu_combined", "team_six_dgu"
_ROWS = [row.key for row in table.TABLE if row.kind is TopicKind.PER_STEP]
_OF_TEAM = ["received", "announced", "estimate"]


@pytest.mark.parametrize(("name", "key"), [*((_COMBINED, key) for key in _ROWS), *((_TEAM, key) for key in _OF_TEAM)])
def test_a_bag_without_a_topic_is_read_or_refused_in_one_line(name: str, key: str, tmp_path: Path) -> None:
    """Without one topic of a row, or all of them: the run ends well, and reading or replaying names the topic."""
    scenario = load_scenario(scenario_path(name), ["duration_sec=0.2", "attacks=[]"])
    topics = topics_of(scenario)
    row = next(row for row in table.TABLE if row.key == key)
    names = [topics.topic(row, place).name for place in topics.places(row.over)] if topics.has(row.need) else []
    for number, left_out in enumerate((names[:1], names)):
        bag = simulate_to_bag(
            scenario, tmp_path / str(number), recording=Recording(topics=TopicFilter(exclude=tuple(left_out)))
        )
        for read in (read_run, replay):
            try:
                read(bag)
            except BagError as error:
                told = str(error)
                assert "\n" not in told
                assert any(one in told for one in left_out), told
