"""The hosts file: which node runs where, and one line for whatever is wrong in it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from dcmg_bringup.hosts.errors import HostsError
from dcmg_bringup.hosts.hosts_file import HERE, HostsFile, load_hosts
from dgu_sim.errors import ScenarioError

if TYPE_CHECKING:
    from collections.abc import Mapping

NODES = ("clock", *(f"dgu_{one}" for one in range(1, 5)), "attacker", *(f"monitor_{one}" for one in (1, 2)), "recorder")
PAGE = (Path(__file__).parents[2] / "docs" / "hosts.md").read_text()
GOOD: Mapping[str, object] = {
    "here": "10.0.0.1",
    "hosts": {"a": {"address": "10.0.0.2"}, "b": {"address": "10.0.0.3", "ssh": "me@b"}},
    "place": {"dgu_*": ["a", "b"], "dgu_3": "here", "monitor_*": "b"},
}


def _written(folder: Path, **changes: object) -> Path:
    path = folder / "hosts.yaml"
    path.write_text(yaml.safe_dump({**GOOD, **changes}, sort_keys=False))
    return path


def test_nodes_go_where_the_rules_say(tmp_path: Path) -> None:
    """A name goes before patterns, a list takes nodes in turn, and what no rule names is here."""
    placed = load_hosts(_written(tmp_path)).placed(NODES)
    assert placed == {
        "here": ("clock", "dgu_3", "attacker", "recorder"),
        "a": ("dgu_1", "dgu_4"),
        "b": ("dgu_2", "monitor_1", "monitor_2"),
    }


def test_the_page_shows_a_file_that_is_one(tmp_path: Path) -> None:
    """The example of docs/hosts.md is read, and its rules name nodes."""
    (text,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    path = tmp_path / "hosts.yaml"
    path.write_text(text)
    hosts = load_hosts(path)
    hosts.check_nodes(NODES, "hosts.yaml")
    assert hosts.placed(NODES)["lab2"] == ("dgu_1", "dgu_2", "dgu_4", "monitor_1")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"here": "lab1"}, "here = 'lab1': expected an IPv4 address"),
        ({"here": "0.0.0.0"}, "here = '0.0.0.0': expected the IPv4 address of one interface"),  # noqa: S104 - refused
        ({"here": "127.0.0.1"}, "expected loopback addresses only, or none"),
        ({"hosts": {"here": {"address": "10.0.0.2"}}}, "expected another name: here is the machine of the command"),
        ({"hosts": {"a": {"adress": "10.0.0.2"}}}, "hosts.a.adress = '10.0.0.2': no such key: did you mean address?"),
        ({"hosts": {"a": {"address": "10.0.0.2", "port": 0}}}, "hosts.a.port"),
        ({"hosts": {"a": {"address": "10.0.0.2", "ssh": "-oProxyCommand=x"}}}, "hosts.a.ssh"),
        ({"hosts": {}}, "hosts"),
        ({"place": {"dgu_*": "c"}}, "place.dgu_* = 'c': expected a host: here, a, b"),
        ({"place": {"dgu_*": []}}, "place.dgu_*"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(tmp_path: Path, changes: Mapping[str, object], said: str) -> None:
    """With file, key, value and what was expected."""
    with pytest.raises(ScenarioError) as error:
        load_hosts(_written(tmp_path, **changes))
    assert str(error.value).startswith(str(tmp_path / "hosts.yaml"))
    assert "\n" not in str(error.value)
    assert said in str(error.value)


@pytest.mark.parametrize(
    ("place", "said"),
    [
        ({"dgu_7": "a"}, "place: dgu_7: expected nodes of the run: clock"),
        ({"recorder": "a"}, "place: recorder = a: expected here: the bag is written where the command is"),
    ],
)
def test_rules_must_fit_the_run(tmp_path: Path, place: Mapping[str, object], said: str) -> None:
    """A rule for no node of the run, and a recorder elsewhere, are refused."""
    with pytest.raises(HostsError, match=re.escape(said)):
        load_hosts(_written(tmp_path, place=place)).check_nodes(NODES, "hosts.yaml")


@given(
    st.dictionaries(st.sampled_from([*NODES, "dgu_*", "*", "monitor_*"]), st.sampled_from(["a", "b", HERE]), min_size=1)
)
def test_every_node_runs_once(place: dict[str, str]) -> None:
    """Whatever the rules, each node has exactly one host, and none is made up."""
    placed = HostsFile.model_validate({**GOOD, "place": place}).placed(NODES)
    assert sorted(node for members in placed.values() for node in members) == sorted(NODES)
