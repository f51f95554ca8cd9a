"""`dcmg host`: waits for commands, each served by a process of its own that ends with the run."""

from __future__ import annotations

import multiprocessing
import os
import select
import socket
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import setproctitle

from bags.orphans import die_with
from dcmg_bringup.hosts.agent import Agent
from dcmg_bringup.hosts.channel import Channel, Side
from dcmg_bringup.hosts.errors import ChannelError, HostsError
from dcmg_bringup.hosts.job import Store
from dcmg_bringup.hosts.versions import versions
from dcmg_bringup.interruptions import end_by_signals, held_back, interruptions

if TYPE_CHECKING:
    from multiprocessing.context import ForkProcess

_POLL_SEC = 0.2
_HANDS_SEC = 5.0
_MOST = 16  # commands at once
_GRACE_SEC = 10.0


def wait_at(where: tuple[str, int], secret: bytes) -> None:
    """Serve commands that know the secret until a signal comes; no process is left then.

    Raises:
        HostsError: nobody can wait there.
    """
    versions()  # every process of ours knows it then
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as listener, tempfile.TemporaryDirectory() as folder:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind(where)
        except OSError as error:
            raise HostsError(f"--listen {where[0]}:{where[1]}: {error.strerror}") from error
        listener.listen()
        _say(f"waits on {where[0]}:{where[1]} for `dcmg run --hosts`; Ctrl-C ends it")
        serving: list[ForkProcess] = []
        with interruptions() as told:
            while not told:
                serving = [one for one in serving if one.is_alive()]
                if len(serving) < _MOST and select.select([listener], [], [], _POLL_SEC)[0]:
                    serving.append(_served(listener, secret, Path(folder)))
        for one in serving:
            one.terminate()
        for one in serving:
            one.join(_GRACE_SEC)
            one.kill()


def serve_stdio() -> None:
    """Serve the one command at the other end of standard input and output, whom ssh has let in."""
    outward = os.dup(sys.stdout.fileno())
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # nothing else may write between the messages
    channel = Channel(sys.stdin.fileno(), outward, Side.HOST, lambda: os.close(outward))
    with tempfile.TemporaryDirectory() as folder:
        _serve(channel, b"", Path(folder), "ssh")


def _served(listener: socket.socket, secret: bytes, folder: Path) -> ForkProcess:
    connection, (address, _) = listener.accept()
    process = multiprocessing.get_context("fork").Process(
        target=_process, args=(os.getpid(), (listener, connection), address, secret, folder)
    )
    with held_back():
        process.start()
    connection.close()
    return process


def _process(
    parent: int, sockets: tuple[socket.socket, socket.socket], address: str, secret: bytes, folder: Path
) -> None:
    listener, connection = sockets
    end_by_signals()
    die_with(parent)
    listener.close()
    setproctitle.setproctitle(f"dcmg host for {address}")
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    channel = Channel(connection.fileno(), connection.fileno(), Side.HOST, connection.close)
    _serve(channel, secret, folder, address)


def _serve(channel: Channel, secret: bytes, folder: Path, address: str) -> None:
    def say(line: str) -> None:
        _say(f"{address}: {line}")

    try:
        channel.shake_hands(secret, _HANDS_SEC)
        Agent(channel, Store(folder), say).serve()
    except ChannelError as error:
        say(str(error))
    finally:
        channel.close()


def _say(line: str) -> None:
    sys.stderr.write(f"dcmg host: {line}\n")
    sys.stderr.flush()
