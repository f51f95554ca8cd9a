"""What a command shows of a bag that holds only some topics."""

from pathlib import Path

import pytest

from bags.mcap.recording import Recording, TopicFilter
from bags.runs.offline import simulate_to_bag
from bags.watch.scenarios import load_scenario
from dcmg.commands.showing import is_partial, show
from dcmg.shipped import scenario_path


@pytest.mark.parametrize("topic", ["/dgu_1/verdict", "/dgu_1/own", "/dgu_1/residual/dgu_1", "/dgu_2/input/dgu_1"])
def test_a_topic_of_the_combined_monitor_left_out(
    topic: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A bag without what only combined monitors say is shown as one with too little for a report."""
    scenario = load_scenario(scenario_path("gallo_six_dgu_combined"), ["duration_sec=0.1"])
    recording = Recording(topics=TopicFilter(exclude=(topic,)))
    assert is_partial(scenario, recording)
    assert not is_partial(scenario, Recording())
    if topic == "/dgu_1/verdict":
        bag = simulate_to_bag(scenario, tmp_path / "bag", recording=recording)
        show(bag, None, json=False, partial=True)
        assert "no report" in capsys.readouterr().out
