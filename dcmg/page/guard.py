"""Who may talk to the page: right host, right origin, a token beyond this machine, nothing from elsewhere."""

import ipaddress
import secrets
from dataclasses import dataclass, field
from http.cookies import SimpleCookie

from starlette.datastructures import Headers, QueryParams
from starlette.responses import PlainTextResponse, RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

COOKIE = "dcmg_page"
_HEADERS = {
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "cache-control": "no-store",
}


def is_loopback(host: str) -> bool:
    """Whether an address means this machine alone."""
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return host == "localhost"


@dataclass(frozen=True, slots=True, kw_only=True)
class Keys:
    """What the page's visitors must know.

    Attributes:
        token: What the address must hold; None: whoever is on this machine may look.
        secret: What the first message must hold: it stands in the page itself, which no other site can read.
        defender: The same of the page of a challenge's defender.
    """

    token: str | None
    secret: str = field(default_factory=lambda: secrets.token_urlsafe(24))
    defender: str = field(default_factory=lambda: secrets.token_urlsafe(24))

    @classmethod
    def for_host(cls, host: str) -> "Keys":
        """A token wherever others can reach the page."""
        return cls(token=None if is_loopback(host) else secrets.token_urlsafe(18))


class Guard:
    """ASGI middleware that lets nobody in who should not be, and sends the headers that keep the page to itself.

    Args:
        app: The page.
        keys: What visitors must know.
    """

    def __init__(self, app: ASGIApp, keys: Keys) -> None:
        """Stand before the page."""
        self._app, self._keys = app, keys

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let a request or a socket through, or refuse it."""
        if scope["type"] not in {"http", "websocket"}:
            await self._app(scope, receive, send)
            return

        async def sealed(message: Message) -> None:
            if message["type"] == "http.response.start":
                more = [(name.encode(), value.encode()) for name, value in _HEADERS.items()]
                message = {**message, "headers": [*message["headers"], *more]}
            await send(message)

        headers = Headers(scope=scope)
        fault = self._fault(headers, scope)
        asked = QueryParams(scope["query_string"]).get("token")
        if fault is None and scope["type"] == "http" and asked is not None and self._keys.token is not None:
            answer = RedirectResponse(scope["path"], status_code=303)  # the token does not stay in the address
            answer.set_cookie(COOKIE, asked, httponly=True, samesite="strict")
            await answer(scope, receive, sealed)
        elif fault is None:
            await self._app(scope, receive, sealed)
        elif scope["type"] == "http":
            await PlainTextResponse(f"{fault}\n", status_code=403)(scope, receive, sealed)
        else:
            await receive()
            await send({"type": "websocket.close", "code": 1008, "reason": fault})

    def _fault(self, headers: Headers, scope: Scope) -> str | None:
        host = headers.get("host", "")
        # a name that somebody else's server points to this machine is no way in
        if self._keys.token is None and not is_loopback(_without_port(host)):
            return f"host {host[:80]!r}: expected this machine"
        origin = headers.get("origin")
        if scope["type"] == "websocket" and origin not in {f"http://{host}", f"https://{host}"}:
            return "origin: expected this page"
        if self._keys.token is not None:
            given = QueryParams(scope["query_string"]).get("token") or _cookie(headers)
            if not secrets.compare_digest(given.encode(), self._keys.token.encode()):
                return "token: expected the one in the address that `dcmg page` printed"
        return None


def _without_port(host: str) -> str:
    return host[: host.index("]") + 1] if host.startswith("[") and "]" in host else host.partition(":")[0]


def _cookie(headers: Headers) -> str:
    found = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
    return found.value if found else ""
