"""What the page's server lets in, and what it says to whom."""

from __future__ import annotations

import json
import re
import socket
import urllib.error
import urllib.request
from contextlib import ExitStack, suppress
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from contextlib import AbstractContextManager

VIEW = {"kind": "view", "panels": ["voltage", "1-2", "heat"], "span_sec": 5, "pixels": 100}


@pytest.fixture(name="address", scope="module")
def _address(serving: Callable[..., AbstractContextManager[str]]) -> Iterator[str]:
    with serving("gallo_six_dgu", "--set", "attacks=[]", "--paused") as address:
        yield address


def _get(address: str, headers: Mapping[str, str] | None = None) -> tuple[int, str, Mapping[str, str]]:
    try:
        with urllib.request.urlopen(urllib.request.Request(address, headers=dict(headers or {}))) as answer:  # noqa: S310
            return answer.status, answer.read().decode(), dict(answer.headers)
    except urllib.error.HTTPError as error:
        return error.code, error.read().decode(), dict(error.headers)


def _secret(address: str) -> str:
    found = re.search(r'name="secret" content="([^"]+)"', _get(address)[1])
    assert found
    return found[1]


def _socket(address: str, origin: str | None = None) -> ClientConnection:
    parts = urlsplit(address)
    own = Origin(f"http://{parts.netloc}" if origin is None else origin)
    return connect(f"ws://{parts.netloc}/live", origin=own, max_size=None, legacy=True)


def _hello(browser: ClientConnection, secret: str) -> dict[str, Any]:
    browser.send(json.dumps({"kind": "hello", "secret": secret, "view": VIEW}))
    return _heard(browser, "outline", "bye")


def _heard(browser: ClientConnection, *kinds: str) -> dict[str, Any]:
    while True:
        message: dict[str, Any] = json.loads(browser.recv(timeout=20))
        if message["kind"] in kinds:
            return message


def _last_byte(connection: socket.socket) -> None:
    """Wait until the other side has closed a connection."""
    connection.settimeout(60)
    with suppress(ConnectionError):
        while connection.recv(4096):
            pass


def _drain(browser: ClientConnection) -> None:
    while True:
        browser.recv(timeout=20)


def _command(browser: ClientConnection, **words: object) -> dict[str, Any]:
    browser.send(json.dumps({"id": 7, **words}))
    return _heard(browser, "reply", "bye")


def test_the_page_keeps_to_itself(address: str) -> None:
    """Nothing is loaded from elsewhere, nobody may frame it, and a file outside is not handed out."""
    status, text, headers = _get(address)
    assert status == 200
    assert "default-src 'none'" in headers["content-security-policy"]
    assert "unsafe" not in headers["content-security-policy"]
    assert "http" not in text.replace("http-equiv", "")
    assert _get(f"{address}static/report.css")[0] == 200
    for name in ("../app.py", "..%2fapp.py", "main.py", "/etc/passwd"):
        assert _get(f"{address}static/{name}")[0] == 404


def test_other_hosts_and_origins_are_refused(address: str) -> None:
    """A foreign name for this machine, and a page of another site, get nothing."""
    assert _get(address, {"Host": "attacker.example"})[0] == 403
    for origin in ("http://attacker.example", "null", address.replace("http", "https").rstrip("/") + "0"):
        with pytest.raises(InvalidStatus):
            _socket(address, origin)


def test_commands_need_the_secret(address: str) -> None:
    """Without the secret of the page there is no outline, and with it the same socket steers."""
    with _socket(address) as browser:
        assert _hello(browser, "guess")["kind"] == "bye"
    with _socket(address) as browser:
        assert _hello(browser, _secret(address))["kind"] == "outline"
        assert _command(browser, kind="clock", action="step", steps=5)["ok"]


@pytest.mark.parametrize("text", ["", "{", "[]", '{"kind": "clock"}', '{"kind": "attack", "id": 1e99}', "x" * 100_000])
def test_malformed_and_huge_messages_end_the_connection_only(address: str, text: str) -> None:
    """Whoever sends nonsense is told goodbye; the next one is served."""
    secret = _secret(address)
    with _socket(address) as browser:
        _hello(browser, secret)
        browser.send(text)
        with pytest.raises(ConnectionClosed):
            _drain(browser)
    with _socket(address) as browser:
        assert _hello(browser, secret)["kind"] == "outline"


def test_many_connections_leave_the_page_alive(address: str) -> None:
    """Sockets beyond the limit are refused; connections that ask for nothing are closed, and so keep nobody out."""
    parts = urlsplit(address)
    idle = [socket.create_connection((parts.hostname or "", parts.port or 0)) for _ in range(200)]
    idle[0].sendall(b"GET / HTTP/1.1\r\nHost: ")  # and one that never finishes its sentence
    for one in idle:
        _last_byte(one)
    secret = _secret(address)
    with ExitStack() as opened:
        for _ in range(16):
            assert _hello(opened.enter_context(_socket(address)), secret)["kind"] == "outline"
        with _socket(address) as late:
            assert json.loads(late.recv(timeout=20))["kind"] == "bye"
    for one in idle:
        one.close()


def test_two_browsers_see_one_truth_and_a_stalled_one_disturbs_nobody(address: str) -> None:
    """What one does the other sees; a browser that reads nothing is given nothing, and the others go on."""
    secret = _secret(address)
    with _socket(address) as one, _socket(address) as two, _socket(address) as stalled:
        for browser in (one, two, stalled):
            _hello(browser, secret)
        assert _command(one, kind="clock", action="step", steps=300)["ok"]
        order = {"kind": "attack", "links": ["1-2"], "attack": "bias", "parameters": {"bias": "0.1 0.1 0.1"}}
        assert _command(one, **order, action="start")["text"] == "started attack 1: bias on 1-2"
        for _ in range(60):
            assert _command(one, kind="clock", action="step", steps=100)["ok"]
        seen = []
        for browser in (one, two):
            browser.send(json.dumps(VIEW))
            frame = _heard(browser, "frame")
            while not (frame["time"]["step"] >= 6300 and frame["series"] and frame["series"][0]["anew"]):
                frame = _heard(browser, "frame")
            seen.append({name: frame[name] for name in ("voltage", "links", "attacks", "details", "series")})
        assert seen[0] == seen[1]
        assert [link["links"] for link in seen[0]["attacks"]] == [["1-2"]]
        assert [one["state"] for one in seen[0]["links"]].count("alarm") == 1


def test_beyond_this_machine_a_token_is_needed(serving: Callable[..., AbstractContextManager[str]]) -> None:
    """Another address than loopback serves nobody without the token that was printed."""
    with serving("isolated_dgu_1", "--host", "0.0.0.0", "--paused") as address:  # noqa: S104
        parts = urlsplit(address)
        here = f"http://127.0.0.1:{parts.port}/"
        assert _get(here)[0] == 403
        assert _get(f"{here}?token=guess")[0] == 403
        assert parts.query.startswith("token=")
        opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
        with opener.open(f"{here}?{parts.query}") as answer:
            assert answer.status == 200
            assert "token" not in answer.url
