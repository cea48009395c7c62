"""Who may reach the page: a gate before everything it serves, web sockets included."""

from __future__ import annotations

import hmac
from collections.abc import Awaitable, Callable, Iterable, MutableMapping
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs, urlsplit

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Scope]]
Send = Callable[[Scope], Awaitable[None]]
ASGIApp = Callable[[Scope, Receive, Send], Awaitable[None]]

COOKIE = "winding_token"
_LOOPBACK_NAMES = ("localhost", "127.0.0.1", "::1")
_POLICY_VIOLATION = 1008


class Gate:
    """ASGI middleware that refuses strangers.

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
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {
            name.decode("latin-1"): value.decode("latin-1") for name, value in scope["headers"]
        }
        refusal = self._stranger(headers)
        if refusal:
            await _refuse(scope, send, 403, refusal)
        elif not self._token or self._matches(_cookie(headers)):
            await self._app(scope, receive, send)
        elif scope["type"] == "http" and self._matches(_query(scope)):
            await _welcome(scope, send, self._token)
        else:
            await _refuse(scope, send, 401, "this page needs its token: open it with ?token=...")

    def _stranger(self, headers: dict[str, str]) -> str:
        host = headers.get("host", "")
        # With a token a foreign host name gains nothing, and machines have many names.
        if not self._token and urlsplit(f"//{host}").hostname not in self._hosts:
            return "this page is served on loopback alone"
        origin = headers.get("origin")
        if origin is not None and urlsplit(origin).netloc != host:
            return "requests from other sites are refused"
        return ""

    def _matches(self, brought: str) -> bool:
        return hmac.compare_digest(brought.encode(), self._token.encode())


def _cookie(headers: dict[str, str]) -> str:
    try:
        jar = SimpleCookie(headers.get("cookie", ""))
    except CookieError:
        return ""
    return jar[COOKIE].value if COOKIE in jar else ""


def _query(scope: Scope) -> str:
    query: bytes = scope.get("query_string", b"")
    return parse_qs(query.decode("latin-1")).get("token", [""])[0]


async def _welcome(scope: Scope, send: Send, token: str) -> None:
    """Hand the token over as a cookie and open the page without it in the address."""
    jar = SimpleCookie()
    jar[COOKIE] = token
    for name, value in (("path", "/"), ("httponly", True), ("samesite", "Strict")):
        jar[COOKIE][name] = value
    headers = (("location", scope["path"]), ("set-cookie", jar[COOKIE].OutputString()))
    await _answer(send, 303, headers, "")


async def _refuse(scope: Scope, send: Send, status: int, sentence: str) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": _POLICY_VIOLATION, "reason": sentence})
        return
    await _answer(send, status, (("content-type", "text/plain; charset=utf-8"),), sentence)


async def _answer(send: Send, status: int, headers: Iterable[tuple[str, str]], body: str) -> None:
    raw = [(name.encode("latin-1"), value.encode("latin-1")) for name, value in headers]
    await send({"type": "http.response.start", "status": status, "headers": raw})
    await send({"type": "http.response.body", "body": body.encode()})
