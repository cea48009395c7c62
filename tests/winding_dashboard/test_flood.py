"""A page that others fill with connections takes an emergency stop, and serves its browsers."""

import asyncio
import http.client
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from processes import serving
from winding_dashboard.web.listening import Bounds, Connections

pytestmark = pytest.mark.timeout(600)

FILES = 512
STOP = "/command/emergency_stop"


class Wire(asyncio.Transport):
    """A connection of one peer, cut or not, on which requests come in parts.

    Attributes:
        more: Parts of the request's body that are there.
    """

    ports = iter(range(1, 60_000))

    def __init__(self, connections: Connections, peer: str = "10.0.0.1") -> None:
        self.client = (peer, next(self.ports))
        super().__init__({"peername": self.client})
        self.cut, self.unsent = False, 0
        self.more: asyncio.Queue[bool] = asyncio.Queue()
        self._connections = connections
        connections.admit(self)

    def abort(self) -> None:
        self.cut = True

    def get_write_buffer_size(self) -> int:
        return self.unsent

    async def ask(self, path: str, method: str, *more: bool) -> "Wire":
        """Let the headers of a request come, and as many parts of its body."""
        scope = {"type": "http", "client": self.client, "path": path, "method": method}

        async def receive() -> dict[str, Any]:
            return {"type": "http.request", "more_body": await self.more.get()}

        for part in more:
            self.more.put_nowait(part)
        self.task = asyncio.create_task(self._connections(scope, receive, None))  # type: ignore
        await turns()
        return self


async def turns() -> None:
    """Let timers that are due run, which they do in the next turns of the loop."""
    for _ in range(5):
        await asyncio.sleep(0)


async def answer(scope: Any, receive: Any, send: Any) -> None:
    """Take a whole body, and answer the path / alone."""
    while scope["method"] == "POST" and (await receive())["more_body"]:
        pass
    if scope["path"] != "/":
        await asyncio.Event().wait()


def test_a_newcomer_takes_the_place_of_the_oldest_half_request() -> None:
    async def work() -> None:
        connections = Connections(answer, Bounds(total=4, per_peer=4, arrival=1e6))
        stop = await Wire(connections).ask(STOP, "POST", False)
        half = [await Wire(connections).ask("/prepare", "POST", True)]
        whole = await Wire(connections).ask("/page.js", "GET")
        half.append(Wire(connections))
        newcomers = [Wire(connections) for _ in range(2)]
        assert [wire.cut for wire in half] == [True, True]
        newcomers += [Wire(connections) for _ in range(50)]
        assert not stop.cut
        assert not whole.cut
        assert [wire.cut for wire in newcomers].count(False) == 2
        assert not newcomers[-1].cut
        # A request that is answered makes room for others, and a stop after all of them.
        busy = [await Wire(connections).ask("/page.js", "GET") for _ in range(9)]
        assert whole.cut
        assert not stop.cut
        assert [wire.cut for wire in busy] == [True] * 6 + [False] * 3
        assert len(connections) == 4

    asyncio.run(work())


def test_a_peer_crowds_out_nobody_but_itself() -> None:
    async def work() -> None:
        connections = Connections(answer, Bounds(total=6, per_peer=3, arrival=1e6))
        other = Wire(connections, "10.0.0.2")
        crowd = [Wire(connections, "10.0.0.3") for _ in range(20)]
        assert not other.cut
        assert [wire.cut for wire in crowd].count(False) == 3

    asyncio.run(work())


@pytest.mark.parametrize(
    ("path", "method", "parts", "cut"),
    [
        ("/prepare", "POST", [True, True], True),
        # Answered, and no further one comes.
        ("/", "POST", [False], True),
        ("/", "GET", [], True),
        ("/page.js", "GET", [], False),
        ("/prepare", "POST", [True, False], False),
        (STOP, "POST", [False], False),
    ],
)
def test_a_request_has_to_arrive_whole_in_time(
    path: str, method: str, parts: list[bool], cut: bool
) -> None:
    async def work() -> bool:
        connections = Connections(answer, Bounds(arrival=0.0))
        wire = await Wire(connections).ask(path, method, *parts)
        await turns()
        assert len(connections) == (0 if wire.cut else 1)
        return wire.cut

    assert asyncio.run(work()) is cut


def test_silent_connection_is_cut_and_one_that_still_takes_an_answer_is_not() -> None:
    async def work() -> None:
        connections = Connections(answer, Bounds(arrival=0.0))
        silent, reading = Wire(connections), Wire(connections)
        reading.unsent = 70_000
        await turns()
        assert silent.cut
        assert not reading.cut
        reading.unsent = 0
        await turns()
        assert reading.cut

    asyncio.run(work())


@pytest.fixture
def crowded(crowd: Any) -> Callable[[bytes], tuple[int, Any]]:
    """Serve the page of a made-up run to a crowd that begins a request and goes no further."""

    def serve(opening: bytes) -> tuple[int, Any]:
        words = ("sh", "-c", f'ulimit -n {FILES}; exec "$@"', "sh", sys.executable)
        page = crowd.enter_context(serving(*words, Path(__file__).parent / "controlled_page.py"))
        port = int(page.url.rsplit(":", 1)[1].strip("/"))
        crowd.half_open(port, opening)
        return port, page.process

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
def test_half_open_connections_keep_no_stop_out(crowded: Any, crowd: Any, opening: bytes) -> None:
    port, page = crowded(opening)
    asked = http.client.HTTPConnection("127.0.0.1", port, timeout=60.0)
    crowd.callback(asked.close)
    head = {"Content-Type": "application/json"}
    asked.request("POST", "/command/emergency_stop", body="{}", headers=head)
    assert asked.getresponse().status == 200
    assert page.stdout.readline() == "asked emergency_stop\n"
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
    assert page.stdout.readline() == "asked emergency_stop\n"
    tab.close()
