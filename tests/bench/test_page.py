"""What the page costs: answers to commands, memory, browsers that read nothing, a flood of connections."""

from __future__ import annotations

import json
import re
import resource
import socket
import subprocess
import sys
import time
import urllib.request
from contextlib import ExitStack
from urllib.parse import urlsplit

import psutil
import pytest
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

pytestmark = pytest.mark.bench

PANELS = ["voltage", "current", "alpha", "heat", "1-2"]
ATTACKS, FLOOD = 100, 1000


def _browser(address: str, stack: ExitStack) -> ClientConnection:
    with urllib.request.urlopen(address) as answer:  # noqa: S310 - our own
        found = re.search(r'name="secret" content="([^"]+)"', answer.read().decode())
    assert found
    host = urlsplit(address).netloc
    opened = stack.enter_context(
        connect(f"ws://{host}/live", origin=Origin(f"http://{host}"), max_size=None, legacy=True)
    )
    view = {"kind": "view", "panels": PANELS, "span_sec": 10, "pixels": 800}
    opened.send(json.dumps({"kind": "hello", "secret": found[1], "view": view}))
    return opened


def _until(browser: ClientConnection, kind: str) -> dict[str, object]:
    while True:
        message: dict[str, object] = json.loads(browser.recv(timeout=60))
        if message["kind"] == kind:
            return message


def test_the_page() -> None:
    """Print what the page of six DGUs, 14 links and 100 Hz costs this machine."""
    command = [sys.executable, "-m", "dcmg", "page", "gallo_six_dgu", "--set", "attacks=[]", "--no-browser"]
    with ExitStack() as stack, subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        stack.callback(process.terminate)
        assert process.stdout is not None
        address = process.stdout.readline().strip()
        watched = psutil.Process(process.pid)
        busy, *_ = browsers = [_browser(address, stack) for _ in range(4)]  # nobody reads from the others
        for _ in browsers:
            while int(_until(busy, "frame")["time"]["step"]) < 300:  # type: ignore[index]
                pass
        began, cpu, memory = time.monotonic(), sum(watched.cpu_times()[:2]), watched.memory_info().rss
        late = []
        order = {"kind": "attack", "id": 1, "links": ["1-2"], "attack": "bias", "parameters": {"bias": "0.1 0.1 0.1"}}
        starts = 0
        for _ in range(ATTACKS):
            step = int(_until(busy, "frame")["time"]["step"])  # type: ignore[index]
            told = time.monotonic()
            busy.send(json.dumps({**order, "action": "start"}))
            _until(busy, "reply")
            late.append(time.monotonic() - told)
            starts += int(_until(busy, "frame")["time"]["step"]) > step  # type: ignore[index]
            busy.send(json.dumps({**order, "action": "stop"}))
            _until(busy, "reply")
        seconds = time.monotonic() - began
        share = (sum(watched.cpu_times()[:2]) - cpu) / seconds
        grown = (watched.memory_info().rss - memory) / 1e6
        sys.stdout.write(
            f"\n{ATTACKS} attacks started and stopped: answered after {sorted(late)[50] * 1e3:.1f} ms (median),\n"
        )
        sys.stdout.write(
            f"{max(late) * 1e3:.1f} ms (worst); four browsers, three of which read nothing: {share:.0%} of a core,\n"
        )
        sys.stdout.write(f"{memory / 1e6:.0f} MB, {grown:+.1f} MB in {seconds:.0f} s\n")
        frame = _until(busy, "frame")
        sys.stdout.write(f"steps later than their time: {frame['time']['late']} of {frame['time']['step']}\n")  # type: ignore[index]
        _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (min(hard, 4 * FLOOD), hard))
        parts = urlsplit(address)
        flood = []
        for _ in range(FLOOD):
            one = socket.socket()
            one.settimeout(2)
            try:
                one.connect((parts.hostname, parts.port))
                flood.append(one)
            except OSError:
                one.close()
        before = int(_until(busy, "frame")["time"]["step"])  # type: ignore[index]
        told = time.monotonic()
        while time.monotonic() < told + 3:
            frame = _until(busy, "frame")
        made = int(frame["time"]["step"]) - before  # type: ignore[index]
        sys.stdout.write(
            f"{FLOOD} idle connections, {len(flood)} taken: {made / (time.monotonic() - told):.0f} steps/s go on\n"
        )
        for one in flood:
            one.close()
