"""Serves the page on a socket until a signal."""

from __future__ import annotations

import asyncio
import resource
import socket
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import uvicorn
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol

from winding_dashboard.page.commands import EMERGENCY_STOP

_URGENT = f"/command/{EMERGENCY_STOP}"


@dataclass(frozen=True, kw_only=True)
class Bounds:
    """How many connections the page keeps, and for how long it waits."""

    total: int = 128  # Connections at once
    per_peer: int = 96  # Of one address
    arrival: float = 5.0  # Within which a request has to arrive whole [s]
    unread: float = 20.0  # After which an answer that is not taken is given up [s]


@dataclass(eq=False)
class _Held:
    transport: asyncio.Transport
    since: float  # When its state began, in the loop's time [s]
    answering: bool = False  # Whether a whole request has arrived that is not answered yet
    urgent: bool = False  # Whether that is an emergency stop
    deadline: asyncio.TimerHandle | None = None  # Of the request that is waited for


class Connections:
    """ASGI middleware that knows the server's open connections by host and port of their peers.

    A request has to arrive within seconds, and where there are too many connections the one is
    closed that has kept the server waiting for longest. So no crowd keeps an emergency stop out,
    and its connection is the last to be closed.
    """

    def __init__(self, app: ASGIApp, bounds: Bounds) -> None:
        self._app, self.bounds = app, bounds
        self._open: dict[tuple[str, int], _Held] = {}

    def __len__(self) -> int:
        """Return how many are open."""
        return len(self._open)

    def admit(self, transport: asyncio.Transport) -> None:
        """Take a connection in; of too many, close the one that is waited for longest."""
        own = transport.get_extra_info("socket")
        if own is not None and hasattr(socket, "TCP_USER_TIMEOUT"):
            unread = round(1000.0 * self.bounds.unread)
            own.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, unread)
        newcomer = _Held(transport, since=0.0)
        self._open[_peer(transport)] = newcomer
        self._wait(newcomer)
        host = _peer(transport)[0]
        of_peer = [held for peer, held in self._open.items() if peer[0] == host]
        if len(of_peer) > self.bounds.per_peer:
            self._close_one(of_peer, newcomer)
        if len(self._open) > self.bounds.total:
            self._close_one(list(self._open.values()), newcomer)

    def release(self, transport: asyncio.Transport) -> None:
        """Forget a connection that is closed."""
        held = self._open.get(_peer(transport))
        if held is not None and held.transport is transport:
            del self._open[_peer(transport)]
            self._arrived(held)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Note when a connection's request has arrived whole, and when it is answered."""
        held = self._open.get(tuple(scope.get("client") or ()))
        if scope["type"] != "http" or held is None:
            await self._app(scope, receive, send)
            return

        async def arriving() -> Message:
            message = await receive()
            if not message.get("more_body"):
                self._arrived(held)
            return message

        held.urgent = scope["path"] == _URGENT
        # The others have no body that anything here waits for.
        if scope["method"] != "POST":
            self._arrived(held)
        try:
            await self._app(scope, arriving, send)
        finally:
            if self._open.get(_peer(held.transport)) is held:
                self._wait(held)

    def _wait(self, held: _Held) -> None:
        """Wait for a request, not for ever."""
        self._arrived(held)
        held.answering = held.urgent = False
        held.deadline = asyncio.get_running_loop().call_later(
            self.bounds.arrival, self._give_up, held
        )

    def _arrived(self, held: _Held) -> None:
        """Let the answer take as long as it takes."""
        held.answering, held.since = True, asyncio.get_running_loop().time()
        if held.deadline is not None:
            held.deadline.cancel()

    def _give_up(self, held: _Held) -> None:
        # The answer before may still be on its way.
        if held.transport.get_write_buffer_size():
            self._wait(held)
        else:
            self._close_one([held], held)

    def _close_one(self, crowd: list[_Held], newcomer: _Held) -> None:
        # Half a request before one that is being answered, an emergency stop last, and the oldest.
        worst = min(
            (held for held in crowd if held is not newcomer),
            key=lambda held: (held.urgent, held.answering, held.since),
            default=newcomer,
        )
        self.release(worst.transport)
        worst.transport.abort()


def _peer(transport: asyncio.Transport) -> tuple[str, int]:
    host, port, *_ = transport.get_extra_info("peername") or ("", 0)
    return str(host), int(port)


# Connections that the system holds ready, and how many of them are taken in one turn: each takes a
# file descriptor before another one can be closed for it.
_QUEUE, _AT_ONCE = 1024, 8
# Files that reports, logs and the graph may still open.
_SPARE = 32
_FEWEST = 16
_LAST_ANSWERS = 1  # Browsers that hold a connection must not hold up the end [s]
_IDLE = 4  # A connection without a further request is closed before it counts as half of one [s]


def listen(app: ASGIApp, host: str, port: int) -> None:
    """Serve an application until a signal.

    Raises:
        SystemExit: The port is taken; the reason has been printed.
    """
    connections = Connections(app, bounds_here())

    class Protocol(H11Protocol):
        def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
            super().connection_made(transport)
            connections.admit(transport)

        def connection_lost(self, exc: Exception | None) -> None:
            connections.release(self.transport)
            super().connection_lost(exc)

    config = uvicorn.Config(
        connections,
        host=host,
        port=port,
        log_level="error",
        access_log=False,
        http=Protocol,
        ws="none",
        proxy_headers=False,
        server_header=False,
        backlog=_AT_ONCE,
        timeout_keep_alive=_IDLE,
        timeout_graceful_shutdown=_LAST_ANSWERS,
    )
    with suppress(KeyboardInterrupt):
        _Server(config).run(sockets=[config.bind_socket()])


def bounds_here() -> Bounds:
    """Return how many connections this process can keep beside the files that it needs."""
    most, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    opened = sum(1 for _ in Path("/proc/self/fd").iterdir())
    usual = Bounds()
    # A closed connection holds its descriptor for another turn.
    total = max(_FEWEST, min(usual.total, most - opened - _SPARE - 4 * _AT_ONCE))
    return Bounds(total=total, per_peer=min(usual.per_peer, total))


class _Server(uvicorn.Server):
    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        # What asyncio takes in one turn and what the system holds ready are one number there.
        for listener in sockets or ():
            listener.listen(_QUEUE)
