"""The page as a web application: its files, and a socket for each browser."""

import asyncio
import secrets
import threading
from contextlib import suppress
from importlib.resources import files

from pydantic import BaseModel, ValidationError
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from dcmg.page.contest import Contest
from dcmg.page.foresight import Foresight
from dcmg.page.guard import Guard, Keys
from dcmg.page.messages import (
    Again,
    Attack,
    Bye,
    Clock,
    Cut,
    Hello,
    Outline,
    Reply,
    Seek,
    View,
    WhatIf,
    parse_client,
    schema,
)
from dcmg.page.source import Driver, RefusalError
from dcmg.page.viewer import Role, Viewer

FRAMES_A_SECOND = 20
BROWSERS = 16
_STALLED_SEC, _HELLO_SEC = 20.0, 5.0
_TYPES = {"css": "text/css", "html": "text/html", "js": "text/javascript", "svg": "image/svg+xml"}


class Page:
    """Serves one source to some browsers.

    Args:
        pace: The clock and what it drives.
        keys: What visitors must know.
    """

    def __init__(self, pace: Driver, keys: Keys) -> None:
        """Read the files of the page."""
        self._pace, self._keys = pace, keys
        self._browsers: set[WebSocket] = set()
        self._foresight, self._asking = Foresight(pace.source.fork), threading.Lock()
        self.app = Starlette(
            routes=[
                Route("/", self._index),
                Route("/defender", self._index),
                Route("/schema.json", self._schema),
                Route("/static/{name:path}", self._file),
                WebSocketRoute("/live", self._live),
            ],
            middleware=[Middleware(Guard, keys=keys)],
        )

    async def _index(self, request: Request) -> Response:
        secret = self._keys.defender if request.url.path == "/defender" else self._keys.secret
        text = files("dcmg.page").joinpath("static/index.html").read_text(encoding="utf-8")
        return Response(text.replace("{{secret}}", secret), media_type="text/html")

    async def _schema(self, _: Request) -> Response:
        return JSONResponse(schema())

    async def _file(self, request: Request) -> Response:
        name = request.path_params["name"]
        kind = _TYPES.get(name.rpartition(".")[2])
        found = files("dcmg.page").joinpath("static", name)
        if name == "report.css":  # the same colours and letters
            found = files("bags.reporting").joinpath("style.css")
        if kind is None or ".." in name.split("/") or name.startswith("/") or not found.is_file():
            return Response("not here\n", status_code=404, media_type="text/plain")
        return Response(found.read_bytes(), media_type=kind)

    async def _live(self, socket: WebSocket) -> None:
        await socket.accept()
        if len(self._browsers) >= BROWSERS:
            await _bye(socket, f"{BROWSERS} browsers look at this page already")
            return
        self._browsers.add(socket)
        sending: asyncio.Task[None] | None = None
        try:
            hello = parse_client(await asyncio.wait_for(socket.receive_text(), _HELLO_SEC))
            role = self._role(hello.secret) if isinstance(hello, Hello) else None
            if role is None or not isinstance(hello, Hello):
                await _bye(socket, "this page is of another run: load it anew")
                return
            viewer = Viewer(self._pace, role)
            viewer.look(hello.view)
            await _send(socket, self._outline(role))
            sending = asyncio.create_task(self._show(socket, viewer))
            while True:
                await self._take(socket, viewer, role, await socket.receive_text())
        except (WebSocketDisconnect, TimeoutError, RuntimeError, KeyError):
            pass  # it is gone, or never said a word
        except ValidationError as error:
            with suppress(WebSocketDisconnect, RuntimeError):
                await _bye(socket, f"not a message of this page: {error.error_count()} fault(s)")
        finally:
            self._browsers.discard(socket)
            if sending is not None:
                sending.cancel()

    def _role(self, secret: str) -> Role | None:
        """Who knows this secret."""
        roles: dict[Role, str] = {"attacker": self._keys.secret, "defender": self._keys.defender}
        return next(
            (role for role, one in roles.items() if secrets.compare_digest(secret.encode(), one.encode())), None
        )

    def _outline(self, role: Role) -> Outline:
        """What somebody may do: a defender of a challenge leaves links out, and attacks nothing."""
        found = self._pace.source.outline
        if role == "attacker":
            return found
        can = ["cut"] if found.challenge is not None else []
        return found.model_copy(update={"can": can, "attacks": []})

    async def _take(self, socket: WebSocket, viewer: Viewer, role: Role, text: str) -> None:
        message = parse_client(text)
        if isinstance(message, View):
            viewer.look(message)
        elif isinstance(message, Hello):
            pass
        elif isinstance(message, WhatIf) and role == "attacker":
            await _send(socket, await asyncio.to_thread(self._foresee, message))
        elif role == "defender" and not isinstance(message, Cut):
            await _send(socket, Reply(id=message.id, ok=False, text="not the defender's"))
        else:
            ok, said = await asyncio.to_thread(self._do, message)
            await _send(socket, Reply(id=message.id, ok=ok, text=said))

    def _foresee(self, asked: WhatIf) -> BaseModel:
        """Play ahead, one question at a time; what is shown goes on meanwhile."""
        with self._asking:
            try:
                with self._pace.lock:
                    run = self._foresight.fork()
                return self._foresight.ask(run, asked)
            except RefusalError as error:
                return Reply(id=asked.id, ok=False, text=str(error))

    def _do(self, message: Clock | Seek | Attack | WhatIf | Cut | Again) -> tuple[bool, str]:
        pace = self._pace
        with pace.lock:
            try:
                if isinstance(message, Clock):
                    return True, pace.do(message)
                if isinstance(message, Seek):
                    pace.source.seek(message.step)
                    pace.touch()
                    return True, f"at step {pace.source.head}"
                said = self._play(message) if isinstance(message, Cut | Again | WhatIf) else pace.source.attack(message)
            except RefusalError as error:
                return False, str(error)
            pace.version += 1
            return True, said

    def _play(self, message: Cut | Again | WhatIf) -> str:
        """What belongs to a challenge."""
        contest = self._pace.source
        if not isinstance(contest, Contest) or isinstance(message, WhatIf):
            raise RefusalError(f"{message.kind}: only in a challenge")
        if isinstance(message, Cut):
            return contest.cut(message.link, on=message.on)
        contest.again()
        self._pace.touch()
        return "another game"

    async def _show(self, socket: WebSocket, viewer: Viewer) -> None:
        """Send frames, the next one only when the one before has left: a slow browser slows nobody else."""
        with suppress(WebSocketDisconnect, RuntimeError):
            while True:
                if self._pace.fault is not None:
                    await _bye(socket, f"the run has failed: {self._pace.fault}")
                    return
                with self._pace.lock:
                    frame = viewer.frame()
                if frame is not None:
                    try:
                        await asyncio.wait_for(_send(socket, frame), _STALLED_SEC)
                    except TimeoutError:
                        await socket.close(1013)
                        return
                await asyncio.sleep(1 / FRAMES_A_SECOND)


async def _send(socket: WebSocket, message: BaseModel) -> None:
    await socket.send_text(message.model_dump_json())


async def _bye(socket: WebSocket, text: str) -> None:
    await _send(socket, Bye(text=text))
    await socket.close(1008)
