"""A page that others fill with connections takes an emergency stop, and serves its browsers."""

import asyncio
import http.client
import resource
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from winding_dashboard.web.connections import Bounds, Connection, Connections

pytestmark = pytest.mark.timeout(600)

FILES, CROWD = 512, 1200
STOP = b"POST /command/emergency_stop HTTP/1.1\r\ncontent-length: 2\r\n\r\n{}"


class Wire(asyncio.Transport):
    """A transport that notes whether it was cut, and the protocol that speaks HTTP behind it."""

    def __init__(self, peer: str) -> None:
        super().__init__({"peername": (peer, 1)})
        self.cut = False
        self.got = bytearray()

    def abort(self) -> None:
        self.cut = True

    # Of the protocol.
    def connection_made(self, transport: Any) -> None:
        assert transport is self

    def data_received(self, data: bytes) -> None:
        self.got += data


def admitted(connections: Connections, data: bytes = b"", peer: str = "10.0.0.1") -> Wire:
    wire = Wire(peer)
    connection = Connection(wire, connections)
    wire.connection = connection  # type: ignore[attr-defined]
    connection.connection_made(wire)
    # As it comes over a network.
    for part in (data[i : i + 7] for i in range(0, len(data), 7)):
        connection.data_received(part)
    assert bytes(wire.got) == data
    return wire


def test_a_newcomer_takes_the_place_of_the_oldest_half_request() -> None:
    async def work() -> None:
        connections = Connections(Bounds(total=4, per_peer=4, arrival=1e6))
        stop = admitted(connections, STOP)
        half = [admitted(connections, b"POST /prepare HTTP/1.1\r\nContent-Length: 9\r\n\r\nshort")]
        whole = admitted(connections, b"GET / HTTP/1.1\r\nhost: a\n\n")
        half.append(admitted(connections, b"GET / HTTP/1.1\r\n"))
        newcomers = [admitted(connections) for _ in range(2)]
        assert [wire.cut for wire in half] == [True, True]
        newcomers += [admitted(connections) for _ in range(50)]
        assert not stop.cut
        assert not whole.cut
        assert [wire.cut for wire in newcomers].count(False) == 2
        assert not newcomers[-1].cut
        # A request that is answered makes room for others, and a stop after all of them.
        busy = [admitted(connections, b"GET / HTTP/1.1\r\n\r\n") for _ in range(9)]
        assert whole.cut
        assert not stop.cut
        assert [wire.cut for wire in busy] == [True] * 6 + [False] * 3
        assert len(connections) == 4

    asyncio.run(work())


def test_a_peer_crowds_out_nobody_but_itself() -> None:
    async def work() -> None:
        connections = Connections(Bounds(total=6, per_peer=3, arrival=1e6))
        other = admitted(connections, b"GET / HT", peer="10.0.0.2")
        crowd = [admitted(connections, peer="10.0.0.3") for _ in range(20)]
        assert not other.cut
        assert [wire.cut for wire in crowd].count(False) == 3

    asyncio.run(work())


@pytest.mark.parametrize(
    ("sent", "cut"),
    [
        (b"", True),
        (b"GET /page.js HTTP/1.1\r\nhost: 127.0.0.1\r\n", True),
        (b"POST /limits HTTP/1.1\r\ncontent-length: 40\r\n\r\n{}", True),
        (b"GET / HTTP/1.1\r\n\r\nGET / HT", True),
        (b"x" * 200_000, True),
        (b"GET / HTTP/1.1\r\nhost: 127.0.0.1\r\n\r\n", False),
        (b"GET / HTTP/1.1\r\n\r\nGET / HTTP/1.1\r\n\r\n", False),
        (STOP, False),
    ],
)
def test_a_request_has_to_arrive_whole_in_time(sent: bytes, cut: bool) -> None:
    async def work() -> bool:
        connections = Connections(Bounds(arrival=0.0))
        wire = admitted(connections, sent)
        # Timers that are due run in the next turns of the loop.
        for _ in range(5):
            await asyncio.sleep(0)
        assert len(connections) == (0 if wire.cut else 1)
        return wire.cut

    assert asyncio.run(work()) is cut


@pytest.fixture
def crowd() -> Iterator[ExitStack]:
    """Let this process hold a crowd's connections."""
    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(limits[0], CROWD + 500), limits[1]))
    with ExitStack() as stack:
        yield stack
    resource.setrlimit(resource.RLIMIT_NOFILE, limits)


@pytest.fixture
def crowded(serving: Any, crowd: ExitStack) -> Callable[[bytes], tuple[int, Any]]:
    """Serve the page of a made-up run to a crowd that begins a request and goes no further."""

    def serve(opening: bytes) -> tuple[int, Any]:
        port = serving.free_port()
        page = crowd.enter_context(
            subprocess.Popen(
                ["sh", "-c", f'ulimit -n {FILES}; exec "$@"', "sh", sys.executable,
                 str(Path(__file__).parent / "controlled_page.py"), str(port)],
                stdout=subprocess.PIPE,
                text=True,
            )
        )  # fmt: skip
        crowd.callback(page.terminate)
        serving.wait_for_page(f"http://127.0.0.1:{port}/")
        for _ in range(CROWD):
            connection = crowd.enter_context(socket.create_connection(("127.0.0.1", port)))
            connection.sendall(opening)
        return port, page

    return serve


@pytest.mark.slow
@pytest.mark.parametrize(
    "opening",
    [
        b"GET / HTTP/1.1\r\nhost: 127.0.0.1\r\nx-wait: ",
        b"POST /prepare HTTP/1.1\r\nhost: 127.0.0.1\r\ncontent-type: application/json\r\n"
        b"content-length: 90000\r\n\r\n{",
        b"",
    ],
    ids=["half headers", "half bodies", "nothing"],
)
def test_a_crowd_of_half_open_connections_keeps_no_stop_out(
    crowded: Any, crowd: ExitStack, opening: bytes
) -> None:
    port, page = crowded(opening)
    asked = http.client.HTTPConnection("127.0.0.1", port, timeout=60.0)
    crowd.callback(asked.close)
    head = {"Content-Type": "application/json"}
    asked.request("POST", "/command/emergency_stop", body="{}", headers=head)
    assert asked.getresponse().status == 200
    assert page.stdout.readline() == "told emergency_stop\n"
    opened = len(list(Path(f"/proc/{page.pid}/fd").iterdir()))
    assert opened < FILES // 2
    asked.close()
    asked.request("GET", "/snapshot")
    assert asked.getresponse().status == 200


@pytest.mark.slow
@pytest.mark.parametrize("by", ["mouse", "keyboard"])
def test_a_browser_stops_the_machine_through_a_crowd(crowded: Any, browser: Any, by: str) -> None:
    port, page = crowded(b"GET /snapshot HTTP/1.1\r\n")
    tab = browser.new_page(viewport={"width": 390, "height": 844})
    tab.goto(f"http://127.0.0.1:{port}/")
    stop = tab.get_by_role("button", name="EMERGENCY STOP")
    if by == "mouse":
        stop.click()
    else:
        stop.focus()
        tab.keyboard.press("Enter")
    assert page.stdout.readline() == "told emergency_stop\n"
    tab.close()
