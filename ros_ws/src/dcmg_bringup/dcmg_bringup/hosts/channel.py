"""Messages between the command and a host over two file descriptors: a socket, or the pipes of ssh.

Both ends prove that they know the shared secret, and every message carries an HMAC-SHA256 of itself and its number
under a key of this channel alone, k = HMAC(secret, nonces): nobody on the way can forge, change, repeat or leave out
one. Nothing is encrypted.
"""

from __future__ import annotations

import hmac
import json
import os
import secrets
import select
import time
from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING, Any, NamedTuple

from dcmg_bringup.hosts.errors import ChannelError

if TYPE_CHECKING:
    from collections.abc import Callable

_MAGIC = b"dcmg host 1\n"
_NONCE_BYTES = _PROOF_BYTES = 32
_LENGTH_BYTES, _LONGEST = 4, 1 << 22
_READ_BYTES = 1 << 16
_SEND_SEC = 10.0
CHUNK_BYTES = 1 << 20


class Side(Enum):
    """Who speaks."""

    COMMAND = b"command"
    HOST = b"host"

    @property
    def other(self) -> Side:
        """Who hears."""
        return Side.HOST if self is Side.COMMAND else Side.COMMAND


class Message(NamedTuple):
    """What came: plain data, and bytes that go with them."""

    said: dict[str, Any]
    payload: bytes


@dataclass(slots=True)
class Channel:
    """One end of a conversation; `shake_hands` comes first.

    Attributes:
        read_fd: what comes in.
        write_fd: what goes out.
        side: whose end it is.
        on_close: closes both.
        heard: when the last message came, by the monotonic clock [s].
    """

    read_fd: int
    write_fd: int
    side: Side
    on_close: Callable[[], None]
    heard: float = field(default_factory=time.monotonic)
    _key: bytes = b""
    _sent: int = 0
    _taken: int = 0
    _buffer: bytearray = field(default_factory=bytearray)
    _closed: bool = False

    def shake_hands(self, secret: bytes, timeout_sec: float) -> None:
        """Prove the secret to each other, the command first.

        Raises:
            ChannelError: the other end does not know it, speaks another language or says nothing.
        """
        deadline = time.monotonic() + timeout_sec
        os.set_blocking(self.read_fd, False)
        os.set_blocking(self.write_fd, False)
        own = secrets.token_bytes(_NONCE_BYTES)
        self._write(_MAGIC + own)
        opening = self._exactly(len(_MAGIC) + _NONCE_BYTES, deadline)
        if not opening.startswith(_MAGIC):
            raise ChannelError("speaks another language: expected `dcmg host` of this version there")
        other = opening[len(_MAGIC) :]
        nonces = own + other if self.side is Side.COMMAND else other + own
        self._key = hmac.digest(secret, _MAGIC + nonces, "sha256")
        if self.side is Side.COMMAND:
            self._write(self._proof(self.side))
        proof = self._exactly(_PROOF_BYTES, deadline)
        if not hmac.compare_digest(proof, self._proof(self.side.other)):
            raise ChannelError("does not know the shared secret")
        if self.side is Side.HOST:
            self._write(self._proof(self.side))
        self.heard = time.monotonic()

    def send(self, said: dict[str, Any], payload: bytes = b"") -> None:
        """Send one message.

        Raises:
            ChannelError: the other end is gone, or takes nothing for ten seconds.
        """
        text = json.dumps(said).encode()
        body = len(text).to_bytes(_LENGTH_BYTES) + text + payload
        if len(body) > _LONGEST:
            raise ChannelError(f"a message of {len(body)} bytes: expected at most {_LONGEST}")
        self._write(len(body).to_bytes(_LENGTH_BYTES) + body + self._seal(self.side, self._sent, body))
        self._sent += 1

    def receive(self, timeout_sec: float = 0.0) -> Message | None:
        """Return the next message, None when none comes in time.

        Raises:
            ChannelError: the other end is gone, or a message is not from it.
        """
        deadline = time.monotonic() + timeout_sec
        while (message := self._next()) is None:
            if not self._fill(max(0.0, deadline - time.monotonic())):
                return None
        self.heard = time.monotonic()
        return message

    def close(self) -> None:
        """End the conversation; a second call does nothing."""
        if not self._closed:
            self._closed = True
            self.on_close()

    def _next(self) -> Message | None:
        if len(self._buffer) < _LENGTH_BYTES:
            return None
        length = int.from_bytes(self._buffer[:_LENGTH_BYTES])
        if not _LENGTH_BYTES <= length <= _LONGEST:
            raise ChannelError("sent what is no message")
        end = _LENGTH_BYTES + length
        if len(self._buffer) < end + _PROOF_BYTES:
            return None
        body, seal = bytes(self._buffer[_LENGTH_BYTES:end]), bytes(self._buffer[end : end + _PROOF_BYTES])
        del self._buffer[: end + _PROOF_BYTES]
        if not hmac.compare_digest(seal, self._seal(self.side.other, self._taken, body)):
            raise ChannelError("a message was changed on the way")
        self._taken += 1
        cut = _LENGTH_BYTES + int.from_bytes(body[:_LENGTH_BYTES])
        return Message(json.loads(body[_LENGTH_BYTES:cut]), body[cut:])

    def _proof(self, side: Side) -> bytes:
        return hmac.digest(self._key, b"proof " + side.value, "sha256")

    def _seal(self, side: Side, number: int, body: bytes) -> bytes:
        return hmac.digest(self._key, side.value + number.to_bytes(8) + body, "sha256")

    def _exactly(self, size: int, deadline: float) -> bytes:
        while len(self._buffer) < size:
            if not self._fill(max(0.0, deadline - time.monotonic())):
                raise ChannelError("does not answer")
        found = bytes(self._buffer[:size])
        del self._buffer[:size]
        return found

    def _fill(self, timeout_sec: float) -> bool:
        """Take what has come; tell whether anything has."""
        ready, _, _ = select.select([self.read_fd], [], [], timeout_sec)
        if not ready:
            return False
        try:
            data = os.read(self.read_fd, _READ_BYTES)
        except BlockingIOError:
            return False
        except OSError as error:
            raise ChannelError(f"closed the connection ({error.strerror})") from error
        if not data:
            raise ChannelError("closed the connection")
        self._buffer += data
        return True

    def _write(self, data: bytes) -> None:
        left = memoryview(data)
        deadline = time.monotonic() + _SEND_SEC
        while left:
            _, ready, _ = select.select([], [self.write_fd], [], max(0.0, deadline - time.monotonic()))
            if not ready:
                raise ChannelError(f"took nothing for {_SEND_SEC:g} s")
            try:
                left = left[os.write(self.write_fd, left) :]
            except BlockingIOError:
                continue
            except OSError as error:
                raise ChannelError(f"closed the connection ({error.strerror})") from error
