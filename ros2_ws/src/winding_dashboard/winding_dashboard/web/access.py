"""Who may reach the page: a gate before everything it serves, web sockets included."""

from __future__ import annotations

import hmac
from urllib.parse import urlsplit

from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse, RedirectResponse
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocketClose

COOKIE = "winding_token"
_LOOPBACK_NAMES = ("localhost", "127.0.0.1", "::1")
_POLICY_VIOLATION = 1008


class Gate:
    """ASGI middleware that refuses unauthorised requests.

    A web site that the operator's browser has open may send requests to this machine, too: a
    request that names another origin is refused, and on loopback one that names another host.
    The token comes once as `?token=`, then as a cookie.

    Args:
        app: What is behind the gate.
        token: Secret to bring; empty for none.
        host: Address that is served.
    """

    def __init__(self, app: ASGIApp, *, token: str, host: str) -> None:
        self._app = app
        self._token = token
        self._hosts = {*_LOOPBACK_NAMES, host.strip("[]")}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let a request through, or answer it here."""
        answer = self._answer(scope) if scope["type"] in ("http", "websocket") else None
        await (answer or self._app)(scope, receive, send)

    def _answer(self, scope: Scope) -> ASGIApp | None:
        """Return what answers a request in the page's stead; None lets it through."""
        asked = HTTPConnection(scope)
        if refusal := self._stranger(asked):
            return _refusal(scope, 403, refusal)
        if not self._token or self._matches(asked.cookies.get(COOKIE, "")):
            return None
        if scope["type"] == "http" and self._matches(asked.query_params.get("token", "")):
            # The page opens without the token in its address.
            welcome = RedirectResponse(scope["path"], 303)
            welcome.set_cookie(COOKIE, self._token, httponly=True, samesite="strict")
            return welcome
        return _refusal(scope, 401, "this page needs its token: open it with ?token=...")

    def _stranger(self, asked: HTTPConnection) -> str:
        host = asked.headers.get("host", "")
        # With a token a foreign host name gains nothing, and machines have many names.
        if not self._token and urlsplit(f"//{host}").hostname not in self._hosts:
            return "this page is served on loopback alone"
        origin = asked.headers.get("origin")
        if origin is not None and urlsplit(origin).netloc != host:
            return "requests from other sites are refused"
        return ""

    def _matches(self, brought: str) -> bool:
        return hmac.compare_digest(brought.encode(), self._token.encode())


def _refusal(scope: Scope, status: int, sentence: str) -> ASGIApp:
    if scope["type"] == "websocket":
        return WebSocketClose(_POLICY_VIOLATION, sentence)
    return PlainTextResponse(sentence, status)
