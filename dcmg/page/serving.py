"""The page's server: one port, the address on standard output, until Ctrl-C."""

import asyncio
import logging
import socket
import sys
import threading
import webbrowser
from urllib.parse import urlencode

import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol

from dcmg.errors import CommandError
from dcmg.page.app import Page
from dcmg.page.guard import Keys, is_loopback
from dcmg.page.source import Driver

_MESSAGE_BYTES, _CONNECTIONS = 64 * 1024, 128
_SILENT_SEC = 5.0
_SWITCH_SEC = 0.001  # the clock's thread does not wait long for the server's


class _Impatient(H11Protocol):
    """Closes connections on which nobody has asked for anything within some seconds: they keep others out."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self.loop.call_later(_SILENT_SEC, self._give_up)

    def _give_up(self) -> None:
        if self in self.connections and self.cycle is None:  # a socket that was upgraded is not there any more
            self.transport.close()


def serve(pace: Driver, host: str, port: int, *, browser: bool) -> None:
    """Serve until Ctrl-C; the address is the first line on standard output.

    Args:
        pace: The clock and what it drives.
        host: Address to listen at.
        port: Port, 0: any that is free.
        browser: Whether to open a browser.

    Raises:
        CommandError: Nobody can listen there.
    """
    keys = Keys.for_host(host)
    listening = _listen(host, port)
    shown = host if is_loopback(host) or host not in {"0.0.0.0", "::"} else socket.gethostname()  # noqa: S104
    address = f"http://{f'[{shown}]' if ':' in shown else shown}:{listening.getsockname()[1]}/"
    if keys.token is not None:
        address += f"?{urlencode({'token': keys.token})}"
    sys.stdout.write(f"{address}\n")
    sys.stdout.flush()
    config = uvicorn.Config(
        Page(pace, keys).app,
        log_level=logging.CRITICAL,
        access_log=False,
        lifespan="off",
        http=_Impatient,
        ws="websockets-sansio",
        ws_max_size=_MESSAGE_BYTES,
        ws_per_message_deflate=False,
        ws_ping_interval=10,
        ws_ping_timeout=20,
        limit_concurrency=_CONNECTIONS,
        timeout_keep_alive=5,
        timeout_graceful_shutdown=1,
        server_header=False,
    )
    if browser:
        threading.Timer(0.3, webbrowser.open, [address]).start()
    sys.setswitchinterval(_SWITCH_SEC)
    pace.start()
    try:
        asyncio.run(uvicorn.Server(config).serve(sockets=[listening]))
    except KeyboardInterrupt:
        pass
    finally:
        pace.close()
        listening.close()


def _listen(host: str, port: int) -> socket.socket:
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        listening = socket.socket(family, socket.SOCK_STREAM)
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind((host, port))
        listening.listen(128)
    except OSError as error:
        raise CommandError(f"--host {host} --port {port}: {error.strerror or error}") from error
    return listening
