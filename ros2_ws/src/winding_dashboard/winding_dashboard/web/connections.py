"""Which connections the page keeps: a newcomer always gets in, whoever is slowest makes room.

A web server that waits for requests can be filled by connections that never finish one. Here a
request has to arrive within seconds, and where there are too many connections the one is closed
that has kept the server waiting for longest. So no crowd keeps an emergency stop out, and its
connection is the last to be closed.
"""

from __future__ import annotations

import asyncio
import re
import socket
from dataclasses import dataclass
from typing import Any

from winding_dashboard.page.commands import EMERGENCY_STOP

# A header may end in bare line feeds (RFC 9112, 2.2).
_END = re.compile(rb"\r?\n\r?\n")
_LENGTH = re.compile(rb"\ncontent-length:[ \t]*(\d{1,15})[ \t]*\r?(?:\n|$)", re.IGNORECASE)
_URGENT = re.compile(rb"POST +/command/" + EMERGENCY_STOP.encode() + rb"[ ?]")
# The HTTP parser refuses longer ones [bytes].
_LONGEST_HEADER = 65_536


@dataclass(frozen=True, kw_only=True)
class Bounds:
    """How many connections the page keeps, and for how long it waits."""

    total: int = 128  # Connections at once
    per_peer: int = 96  # Of one address
    arrival: float = 5.0  # Within which a request has to arrive whole [s]
    unread: float = 20.0  # After which an answer that is not taken is given up [s]


class Connections:
    """The open connections of a server, those first that came first.

    Args:
        bounds: Of them.
    """

    def __init__(self, bounds: Bounds) -> None:
        self.bounds = bounds
        self._open: dict[Connection, str] = {}

    def __len__(self) -> int:
        """Return how many are open."""
        return len(self._open)

    def admit(self, newcomer: Connection, peer: str) -> None:
        """Take a connection in; of too many, close the one that is waited for longest."""
        self._open[newcomer] = peer
        of_peer = [other for other, address in self._open.items() if address == peer]
        if len(of_peer) > self.bounds.per_peer:
            self._close_one(of_peer, newcomer)
        if len(self._open) > self.bounds.total:
            self._close_one(list(self._open), newcomer)

    def release(self, connection: Connection) -> None:
        """Forget a connection."""
        self._open.pop(connection, None)

    def _close_one(self, crowd: list[Connection], newcomer: Connection) -> None:
        # Half a request before one that is being answered, an emergency stop last, and the oldest.
        min(
            (item for item in crowd if item is not newcomer),
            key=lambda item: (item.urgent, item.answering, item.since),
            default=newcomer,
        ).abort()


class Connection(asyncio.Protocol):
    """One connection: bytes go to the HTTP protocol behind it, and requests are waited for.

    Args:
        behind: Speaks HTTP.
        connections: Among which it is.

    Attributes:
        answering: Whether a whole request has arrived and nothing of a next one.
        urgent: Whether its newest request is an emergency stop.
        since: When that state began, in the loop's time [s].
    """

    def __init__(self, behind: Any, connections: Connections) -> None:
        self._behind, self._connections = behind, connections
        self._loop = asyncio.get_running_loop()
        self._transport: asyncio.Transport | None = None
        self._header = bytearray()
        self._missing = 0
        self._deadline: asyncio.TimerHandle | None = None
        self.answering = self.urgent = False
        self.since = self._loop.time()

    def connection_made(self, transport: Any) -> None:
        """Begin to wait for a request."""
        self._transport = transport
        own = transport.get_extra_info("socket")
        if own is not None and hasattr(socket, "TCP_USER_TIMEOUT"):
            unread = round(1000.0 * self._connections.bounds.unread)
            own.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, unread)
        peer = transport.get_extra_info("peername") or ("",)
        self._wait()
        self._connections.admit(self, str(peer[0]))
        self._behind.connection_made(transport)

    def data_received(self, data: bytes) -> None:
        """Hand bytes on, and note where requests begin and end in them."""
        self._note(memoryview(data))
        self._behind.data_received(data)

    def eof_received(self) -> bool | None:
        """Hand the end of the stream on."""
        return bool(self._behind.eof_received())

    def connection_lost(self, exc: Exception | None) -> None:
        """Make room."""
        self._answer()
        self._connections.release(self)
        self._behind.connection_lost(exc)

    def pause_writing(self) -> None:
        """Hand on that the other side reads slowly."""
        self._behind.pause_writing()

    def resume_writing(self) -> None:
        """Hand on that it has caught up."""
        self._behind.resume_writing()

    def abort(self) -> None:
        """Close it now, whatever is unsent."""
        self._connections.release(self)
        if self._transport is not None:
            self._transport.abort()

    def _note(self, data: memoryview) -> None:
        while data:
            if self.answering:
                self._wait()
            if self._missing:
                taken = min(self._missing, len(data))
                self._missing -= taken
                data = data[taken:]
                if not self._missing:
                    self._answer()
                continue
            seen = max(0, len(self._header) - 3)
            self._header += data
            end = _END.search(self._header, seen)
            if end is None:
                del self._header[_LONGEST_HEADER:]
                return
            data = data[len(data) - (len(self._header) - end.end()) :]
            del self._header[end.start() :]
            length = _LENGTH.search(self._header)
            self._missing = 0 if length is None else int(length[1])
            self.urgent = _URGENT.match(self._header) is not None
            self._header.clear()
            if not self._missing:
                self._answer()

    def _wait(self) -> None:
        """Wait for a request, not for ever."""
        self.answering = self.urgent = False
        self.since = self._loop.time()
        self._deadline = self._loop.call_later(self._connections.bounds.arrival, self.abort)

    def _answer(self) -> None:
        """A whole request has arrived: it is answered however long that takes."""
        self.answering = True
        self.since = self._loop.time()
        if self._deadline is not None:
            self._deadline.cancel()
