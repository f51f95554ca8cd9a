"""Monitors that draw one conclusion from several tests, and DGUs that act on it: the same bits in every kind of run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from mcap.reader import make_reader

from bags.runs.reader import read_run
from bags.watch.scenarios import load_scenario
from dcmg.shipped import scenario_path
from dgu_sim.grid import Link

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

_BIAS = "{kind: bias, link: 1-2, start_sec: 0.6, stop_sec: 0.9, bias: [0.5, 5.0, 0.5]}"
_DROP = "{kind: drop, link: 3-4, start_sec: 0.7, stop_sec: 0.8}"
# Noise, random loads, lost samples, an attack with an end and a link that is left out and heard again.
EVERYTHING = (
    "name=everything",
    "duration_sec=1.6",
    "noise={kind: gaussian, std: [0.001, 0.001, 0.0001]}",
    "dgus.0.load=[{kind: constant, current_a: 10}, {kind: uniform, low_a: -0.5, high_a: 0.5}]",
    "monitor.detector.options={settle_sec: 0.1, calibrate_sec: 0.3}",
    "monitor.local={load_sec: 0.1, detector: {options: {settle_sec: 0.1, calibrate_sec: 0.2}}}",
    "monitor.plausibility={limits: {settle_sec: 0.1, calibrate_sec: 0.3, range: [100.0, 10.0], rate: [1000.0, 100.0]}}",
    "monitor.response={quiet_sec: 0.2}",
    f"attacks=[{_BIAS}, {_DROP}]",
)


def payloads(bag: Path) -> dict[str, list[bytes]]:
    """Payload bytes of every topic, in the order of the file."""
    found: dict[str, list[bytes]] = {}
    for path in sorted(bag.glob("*.mcap")):
        with path.open("rb") as stream:
            for _, channel, message in make_reader(stream).iter_messages(log_time_order=False):
                found.setdefault(channel.topic, []).append(message.data)
    return found


@pytest.fixture(name="scenario", scope="module")
def _scenario(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("scenario") / "everything.yaml"
    path.write_text(load_scenario(scenario_path("gallo_six_dgu"), EVERYTHING).to_yaml())
    return path


@pytest.fixture(name="simulated", scope="module")
def _simulated(scenario: Path, dcmg: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("runs") / "simulated"
    finished = dcmg("simulate", scenario, "--no-plots", "--out", out)
    assert finished.code == 0, finished.err
    return out / "bag"


@pytest.mark.parametrize("options", [("--composed",), ()], ids=["composed", "processes"])
def test_every_topic_carries_the_same_bytes(
    scenario: Path, simulated: Path, dcmg: Callable[..., Any], tmp_path: Path, options: tuple[str, ...]
) -> None:
    """With every test and the response on, nodes and the simulation write the same payloads on every topic."""
    finished = dcmg("run", scenario, *options, "--no-plots", "--out", tmp_path / "run")
    assert finished.code == 0, finished.err
    expected, found = payloads(simulated), payloads(tmp_path / "run" / "bag")
    assert {topic: len(data) for topic, data in found.items()} == {t: len(data) for t, data in expected.items()}
    assert [topic for topic in expected if found[topic] != expected[topic]] == []
    assert "in the own state of DGU 2" in finished.err


def test_the_falsified_link_was_left_out_and_heard_again(simulated: Path) -> None:
    """What the runs are compared on really happened: link 1-2 was accused, left out, and heard again."""
    record = read_run(simulated)
    assert record.combined is not None
    dropped = record.combined.verdict.dropped[:, record.links.index(Link(1, 2))]
    assert dropped[60:90].all()
    assert not dropped[:60].any()
    assert not dropped[-1]
