"""Where `dcmg host` waits, and the secret that it shares with the command."""

from __future__ import annotations

import os
import stat
from typing import TYPE_CHECKING

from dcmg_bringup.hosts.errors import HostsError

if TYPE_CHECKING:
    from pathlib import Path

DEFAULT_PORT = 7350  # below the ports of DDS, which begin at 7400
LOOPBACK = "127.0.0.1"
SECRET_VARIABLE = "DCMG_HOST_SECRET"  # noqa: S105 - the name of a variable
_FEWEST_BYTES = 16
_OTHERS = 0o077


def secret_key(path: Path | None) -> bytes:
    """Return the shared secret: of a file that nobody else can read, else of the environment; never an argument.

    Raises:
        HostsError: there is none, or it is short, or others can read it.
    """
    if path is None:
        text = os.environ.get(SECRET_VARIABLE, "").strip().encode()
        where = SECRET_VARIABLE
        if not text:
            wanted = f"{SECRET_VARIABLE} or a secret file, the same on every host: head -c 32 /dev/urandom | base64"
            raise HostsError(f"no shared secret: expected {wanted}")
    else:
        path = path.expanduser()
        where = str(path)
        try:
            found = path.stat()
            text = path.read_bytes().strip()
        except OSError as error:
            raise HostsError(f"{path}: expected a file with the shared secret: {error.strerror}") from error
        if not stat.S_ISREG(found.st_mode) or found.st_mode & _OTHERS or found.st_uid not in {os.geteuid(), 0}:
            raise HostsError(f"{path}: expected a file that you alone can read: chmod 600 {path}")
    if len(text) < _FEWEST_BYTES:
        raise HostsError(f"{where}: expected a secret of at least {_FEWEST_BYTES} characters, found {len(text)}")
    return text


def listening_at(text: str) -> tuple[str, int]:
    """Read ADDRESS or ADDRESS:PORT.

    Raises:
        HostsError: it is neither.
    """
    address, colon, port = text.partition(":")
    if colon and not (port.isdecimal() and 0 < int(port) <= 65535):  # noqa: PLR2004 - the largest port
        raise HostsError(f"--listen {text}: expected ADDRESS or ADDRESS:PORT with a port from 1 to 65535")
    return address or LOOPBACK, int(port) if colon else DEFAULT_PORT
