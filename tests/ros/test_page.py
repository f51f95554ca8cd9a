"""The page of a run over ROS 2: what it shows is the run, and what is done on it is in the bag."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import urllib.request
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import numpy as np
import pytest
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from bags.runs.reader import read_run
from dgu_sim.grid import Link
from dgu_sim.relay import Action

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

VIEW = {"kind": "view", "panels": ["1-2"], "span_sec": 5, "pixels": 1000}


@contextmanager
def _page(domain: int) -> Iterator[str]:
    command = [sys.executable, "-m", "dcmg", "page", "--attach", "--domain", str(domain), "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield process.stdout.readline().strip()
        finally:
            process.terminate()


@contextmanager
def _browser(address: str) -> Iterator[ClientConnection]:
    with urllib.request.urlopen(address) as answer:  # noqa: S310 - our own
        found = re.search(r'name="secret" content="([^"]+)"', answer.read().decode())
    assert found
    host = urlsplit(address).netloc
    with connect(f"ws://{host}/live", origin=Origin(f"http://{host}"), max_size=None, legacy=True) as browser:
        browser.send(json.dumps({"kind": "hello", "secret": found[1], "view": VIEW}))
        yield browser


def _heard(browser: ClientConnection, fits: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    while True:
        message: dict[str, Any] = json.loads(browser.recv(timeout=60))
        if fits(message):
            return message


def _command(browser: ClientConnection, **words: object) -> dict[str, Any]:
    order = {"kind": "attack", "id": 1, "links": ["1-2"], "attack": "bias", "parameters": {"bias": "0.1 0.1 0.1"}}
    browser.send(json.dumps({**order, **words}))
    return _heard(browser, lambda message: message["kind"] == "reply")


def test_an_attack_from_the_page_is_on_the_wire_and_in_the_bag(
    start_run: Callable[..., Any], long_scenario: Path
) -> None:
    """What it shows are the run's own numbers; attacks start, change and stop; the end is told, and the bag offered."""
    run = start_run(long_scenario, "--pacing", "realtime", "--composed")
    run.wait_until_recording()
    with _page(run.domain) as address, _browser(address) as browser:
        outline = _heard(browser, lambda message: message["kind"] == "outline")
        assert (outline["source"], outline["bag"]) == ("ros", str(run.bag))
        place = [one["name"] for one in outline["links"]].index("1-2")
        assert all(one["monitored"] for one in outline["links"])
        _heard(browser, lambda message: message["kind"] == "frame" and message["links"][place]["state"] == "quiet")
        assert _command(browser, action="check")["ok"]
        assert "1-5" in _command(browser, action="check", links=["1-5"])["text"]
        assert _command(browser, action="start")["ok"]
        seen = _heard(browser, lambda one: one["kind"] == "frame" and one["links"][place]["state"] == "alarm")
        assert [one["state"] for one in seen["links"]].count("alarm") == 1
        (detail,) = seen["details"]
        step = seen["time"]["step"] - 1
        assert _command(browser, action="change", parameters={"bias": "0 0.5 0"})["ok"]
        assert not _command(browser, action="change", parameters={"bias": "1"})["ok"]
        assert _command(browser, action="stop")["ok"]
        _heard(browser, lambda message: message["kind"] == "frame" and not message["attacks"])
        assert run.end(signal.SIGINT).code == 0
        end = _heard(browser, lambda message: message["kind"] == "frame" and message["time"]["ended"])
        assert f"dcmg page {run.bag}" in end["log"][-1]["text"]
    record = read_run(run.bag)
    assert [one.action for one in record.events] == [Action.START, Action.STOP, Action.START, Action.STOP]
    assert {str(one.link) for one in record.events} == {"1-2"}
    at = record.links.index(Link(1, 2))
    assert np.array_equal(record.residual[step, at], detail["residual"])


def test_a_run_brings_its_page(start_run: Callable[..., Any], long_scenario: Path) -> None:
    """`dcmg run --page` says an address, somebody looks, and both end together."""
    run = start_run(long_scenario, "--pacing", "realtime", "--composed", "--page")
    assert run.process.stderr is not None
    address = next(line.strip() for line in run.process.stderr if line.startswith("http"))
    with _browser(address) as browser:
        first = _heard(browser, lambda message: message["kind"] == "frame" and message["time"]["step"] > 0)
        _heard(browser, lambda one: one["kind"] == "frame" and one["time"]["step"] > first["time"]["step"])
    run.wait_until_recording()
    assert run.end(signal.SIGINT).code == 0
    with pytest.raises(OSError, match="refused"):
        urllib.request.urlopen(address)  # noqa: S310 - our own
