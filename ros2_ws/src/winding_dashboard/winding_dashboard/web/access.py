"""Who may reach the page: a gate before everything it serves; what browsers may do with it."""

import hmac
from urllib.parse import SplitResult, urlsplit

from starlette.datastructures import MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse, RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocketClose

COOKIE = "winding_token"
_POLICY_VIOLATION = 1008
_LOOPBACK_NAMES = ("localhost", "127.0.0.1", "::1")
_CONTENT = "content-security-policy"
_EVERY_ANSWER = {
    # Scripts and styles from the page's own files; nothing within its text is executed.
    _CONTENT: "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "x-frame-options": "DENY",
    "x-content-type-options": "nosniff",
    # The address may hold the token.
    "referrer-policy": "no-referrer",
    "cross-origin-resource-policy": "same-origin",
}
# A report is one text with its style and its pictures in it; it has no script.
OF_REPORTS = {
    _CONTENT: "default-src 'none'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
}


class Gate:
    """ASGI middleware that refuses unauthorised requests, and limits what browsers do with answers.

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
        """Let a request through, or answer it here, always with headers that limit browsers."""

        async def guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in _EVERY_ANSWER.items():
                    headers.setdefault(name, value)
            await send(message)

        if scope["type"] == "http":
            await (self._answer(scope) or self._app)(scope, receive, guarded)
        elif scope["type"] == "websocket":
            await WebSocketClose(_POLICY_VIOLATION, "this page has no web sockets")(
                scope, receive, send
            )
        else:
            await self._app(scope, receive, send)

    def _answer(self, scope: Scope) -> ASGIApp | None:
        """Return what answers a request in the page's stead; None lets it through."""
        asked = HTTPConnection(scope)
        if refusal := self._foreign(asked):
            return PlainTextResponse(refusal, 403)
        if not self._token or self._matches(asked.cookies.get(COOKIE, "")):
            return None
        if self._matches(asked.query_params.get("token", "")):
            # The page opens without the token in its address.
            welcome = RedirectResponse("/", 303)
            welcome.set_cookie(COOKIE, self._token, httponly=True, samesite="strict")
            return welcome
        return PlainTextResponse("this page needs its token: open it with ?token=...", 401)

    def _foreign(self, asked: HTTPConnection) -> str:
        host = asked.headers.get("host", "")
        # With a token a foreign host name gains nothing, and machines have many names.
        if not self._token and _address(f"//{host}").hostname not in self._hosts:
            return "this page is served on loopback alone"
        origin = asked.headers.get("origin")
        if origin is not None and _address(origin).netloc != host:
            return "requests from other sites are refused"
        return ""

    def _matches(self, brought: str) -> bool:
        return hmac.compare_digest(brought.encode(errors="replace"), self._token.encode())


def _address(text: str) -> SplitResult:
    """Return the parts of an address, all empty where it is none."""
    try:
        return urlsplit(text)
    except ValueError:
        return urlsplit("")
