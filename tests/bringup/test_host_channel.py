"""What the command and a host say to each other: proven, in order, unchanged."""

from __future__ import annotations

import socket
import threading
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dcmg_bringup.hosts.channel import Channel, Side
from dcmg_bringup.hosts.errors import ChannelError, HostsError
from dcmg_bringup.hosts.job import Store, digest_of
from dcmg_bringup.hosts.listening import SECRET_VARIABLE, listening_at, secret_key
from dcmg_bringup.hosts.offsets import better, in_words, measured

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

SECRET = b"a secret of the test"


def _pair(theirs: bytes = SECRET) -> tuple[Channel, Channel, list[Exception]]:
    """Both ends of a channel, and what went wrong at the host's when hands were shaken."""
    one, other = socket.socketpair()
    command = Channel(one.fileno(), one.fileno(), Side.COMMAND, one.close)
    host = Channel(other.fileno(), other.fileno(), Side.HOST, other.close)
    wrong: list[Exception] = []

    def shake() -> None:
        try:
            host.shake_hands(theirs, 5.0)
        except ChannelError as error:
            wrong.append(error)
            host.close()

    thread = threading.Thread(target=shake)
    thread.start()
    try:
        command.shake_hands(SECRET, 5.0)
    except ChannelError as error:
        wrong.append(error)
    thread.join()
    return command, host, wrong


def test_messages_arrive_as_they_were_sent() -> None:
    """Data and bytes, both ways, in order."""
    command, host, wrong = _pair()
    assert wrong == []
    command.send({"job": 1}, b"\0" * 20_000)
    command.send({"start": True})
    host.send({"status": [1, 2]})
    assert host.receive(1.0) == ({"job": 1}, b"\0" * 20_000)
    assert host.receive(1.0) == ({"start": True}, b"")
    assert command.receive(1.0) == ({"status": [1, 2]}, b"")
    assert command.receive() is None
    command.close()
    with pytest.raises(ChannelError, match="closed the connection"):
        host.receive(1.0)
    host.close()


def test_another_secret_is_refused_by_both() -> None:
    """The host says so, and the command hears nothing more than that it hangs up."""
    command, _, wrong = _pair(b"another secret of the test")
    assert {str(error) for error in wrong} == {"does not know the shared secret", "closed the connection"}
    command.close()


@pytest.mark.parametrize(
    "change",
    [
        lambda data: data[:-1] + bytes([data[-1] ^ 1]),  # the seal
        lambda data: data[:9] + bytes([data[9] ^ 1]) + data[10:],  # the words
        lambda data: data + data,  # the same once more
        lambda data: b"\xff" * len(data),
    ],
)
def test_what_was_changed_on_the_way_is_not_believed(change: Callable[[bytes], bytes]) -> None:
    """Nor what is repeated."""
    command, host, _ = _pair()
    command.send({"start": True})
    data = host_raw(host)
    pipe_in, pipe_out = socket.socketpair()
    pipe_out.sendall(change(data))
    host.read_fd = pipe_in.fileno()
    with pytest.raises(ChannelError, match=r"changed on the way|no message"):
        _all_of(host)
    for one in (pipe_in, pipe_out, command, host):
        one.close()


def _all_of(channel: Channel) -> None:
    while channel.receive(1.0) is not None:
        pass


def host_raw(channel: Channel) -> bytes:
    """What has come, before anybody looks at it."""
    channel._fill(1.0)
    data = bytes(channel._buffer)
    channel._buffer.clear()
    return data


def test_who_speaks_another_language_is_refused() -> None:
    """A web browser, say."""
    one, other = socket.socketpair()
    other.sendall(b"GET / HTTP/1.1\r\nHost: somewhere.example\r\n\r\n\r\n\r\n")
    channel = Channel(one.fileno(), one.fileno(), Side.HOST, one.close)
    with pytest.raises(ChannelError, match="speaks another language"):
        channel.shake_hands(SECRET, 1.0)
    channel.close()
    other.close()


def test_a_secret_is_of_a_file_of_ones_own_or_of_the_environment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """None, a short one, and one that others can read are refused in one line."""
    monkeypatch.delenv(SECRET_VARIABLE, raising=False)
    with pytest.raises(HostsError, match="no shared secret"):
        secret_key(None)
    monkeypatch.setenv(SECRET_VARIABLE, "short")
    with pytest.raises(HostsError, match="at least 16 characters, found 5"):
        secret_key(None)
    path = tmp_path / "secret"
    path.write_bytes(SECRET + b"\n")
    path.chmod(0o644)
    with pytest.raises(HostsError, match="that you alone can read"):
        secret_key(path)
    path.chmod(0o600)
    assert secret_key(path) == SECRET
    with pytest.raises(HostsError, match="No such file"):
        secret_key(tmp_path / "none")


def test_addresses_to_wait_at() -> None:
    """Loopback and our port, where nothing else is said."""
    assert listening_at("") == ("127.0.0.1", 7350)
    assert listening_at("10.0.0.2") == ("10.0.0.2", 7350)
    assert listening_at("10.0.0.2:80") == ("10.0.0.2", 80)
    with pytest.raises(HostsError, match="a port from 1 to 65535"):
        listening_at("10.0.0.2:x")


def test_files_are_what_their_hash_says(tmp_path: Path) -> None:
    """A store asks for what it lacks once, and keeps nothing else."""
    store, data = Store(tmp_path), b"scenario"
    assert store.lacks({digest_of(data)}) == [digest_of(data)]
    with pytest.raises(HostsError, match="another content"):
        store.add(digest_of(data), b"something else")
    store.add(digest_of(data), data)
    assert store.lacks({digest_of(data)}) == []
    assert store.read(digest_of(data)) == data


@given(
    st.integers(-(10**15), 10**15),
    st.lists(st.tuples(st.integers(0, 10**10), st.integers(0, 10**10)), min_size=1),
)
def test_the_offset_of_a_clock_is_within_its_bound(true_ns: int, ways: list[tuple[int, int]]) -> None:
    """Whatever the ways there and back take, and for the best of many measurements, too."""
    best: Any = None
    for there, back in ways:
        best = better(best, measured(0, there + true_ns, there + back))
        assert abs(best.offset_ns - true_ns) <= best.bound_ns + 1
    assert best.bound_ns == min((there + back + 1) // 2 for there, back in ways)


def test_offsets_in_words() -> None:
    """What cannot be told from zero is not called a difference."""
    assert in_words("b", measured(0, 100_000, 1_000_000)) == "clock of host b: the same as here, to 0.5 ms"
    assert in_words("b", measured(0, 30_500_000, 1_000_000)) == "clock of host b: 30 ms ahead (to 0.5 ms)"
    assert in_words("b", measured(0, -29_500_000, 1_000_000)) == "clock of host b: 30 ms behind (to 0.5 ms)"
