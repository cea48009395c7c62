"""Serves the page on a socket until a signal."""

from __future__ import annotations

import asyncio
import resource
import socket
from contextlib import suppress
from pathlib import Path

import uvicorn
from starlette.types import ASGIApp
from uvicorn.protocols.http.h11_impl import H11Protocol

from winding_dashboard.web.connections import Bounds, Connections

# Connections that the system holds ready, and how many of them are taken in one turn: each takes a
# file descriptor before another one can be closed for it.
_QUEUE, _AT_ONCE = 1024, 8
# Files that reports, logs and the graph may still open.
_SPARE = 32
_FEWEST = 16
# Browsers that hold a connection must not hold up the end [s].
_LAST_ANSWERS = 1
# A connection without a further request is closed before it counts as half of one [s].
_IDLE = 4


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
