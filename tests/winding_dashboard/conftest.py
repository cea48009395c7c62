"""A real graph that waits for the operator, its page, and a real browser."""

import os
import resource
import socket
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from browser_tab import Tab
from chromium import chromium
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

from processes import COMMAND, PATIENCE, free_port, page_answers, until
from winding_ros import topics
from winding_ros.messages.diagnostics import decode_diagnostics
from winding_ros.messages.rig import decode_joint_state

SIZES = {"desk": (1280, 800), "phone": (390, 844)}
NAMESPACE = "operated"


class Motion:
    """The rig's newest encoder sample, looked at every few milliseconds: nothing queues up.

    Attributes:
        samples: Speed of the cylinder [rad/s] and the time of the look [s since the epoch].
        phase: That the rig has reported last.
    """

    def __init__(self, namespace: str) -> None:
        import rclpy

        self._context = Context()
        rclpy.init(args=["test", "--ros-args", "-r", f"__ns:=/{namespace}"], context=self._context)
        self._node = Node("motion", context=self._context)
        self._subscription = self._node.create_subscription(
            topics.JOINT_STATES.type,
            topics.JOINT_STATES.name,
            lambda message: None,
            QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT),
        )
        self._reports = self._node.create_subscription(
            topics.DIAGNOSTICS.type, topics.DIAGNOSTICS.name, lambda message: None, 100
        )
        self.phase = ""
        self.samples: deque[tuple[float, float]] = deque([(0.0, 0.0)], maxlen=20_000)
        self._quit = threading.Event()
        self._thread = threading.Thread(target=self._look)
        self._thread.start()

    def _look(self) -> None:
        while not self._quit.wait(0.005):
            with self._subscription.handle:
                taken = self._subscription.handle.take_message(topics.JOINT_STATES.type, False)
            if taken is not None:
                speed = decode_joint_state(taken[0])[1].angular_speed
                self.samples.append((time.time(), speed))
            with self._reports.handle:
                taken = self._reports.handle.take_message(topics.DIAGNOSTICS.type, False)
            for status in decode_diagnostics(taken[0])[1] if taken is not None else ():
                if status.name == topics.RIG:
                    self.phase = status.values.get("phase", self.phase)

    def reach(self, phase: str, page: Any) -> None:
        """Wait until the rig reports a phase, while the requests of a page go on."""
        end = time.monotonic() + PATIENCE
        while self.phase != phase:
            assert time.monotonic() < end, f"{self.phase} and not {phase}"
            page.wait_for_timeout(10)

    def close(self) -> None:
        import rclpy

        self._quit.set()
        self._thread.join()
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)


@dataclass(frozen=True, kw_only=True)
class Operated:
    """A graph that stands, and the page that commands it."""

    url: str
    motion: Motion


CROWD = 1200


class Crowd(ExitStack):
    """Connections that are closed with it."""

    def half_open(self, port: int, opening: bytes) -> None:
        """Begin as many requests as a crowd has connections, and go no further."""
        for _ in range(CROWD):
            connection = self.enter_context(socket.create_connection(("127.0.0.1", port)))
            connection.sendall(opening)


@pytest.fixture(scope="module")
def crowd() -> Iterator[Crowd]:
    """Let this process hold a crowd's connections."""
    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(limits[0], 2 * CROWD + 500), limits[1]))
    with Crowd() as crowd:
        yield crowd
    resource.setrlimit(resource.RLIMIT_NOFILE, limits)


@pytest.fixture(scope="module")
def motion_of() -> Iterator[Callable[[str], Motion]]:
    """Follow the machines of namespaces."""
    motions = []

    def follow(namespace: str) -> Motion:
        motions.append(Motion(namespace))
        return motions[-1]

    yield follow
    for motion in motions:
        motion.close()


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pictures")
    print(f"pictures in {folder}")
    return folder


@pytest.fixture(scope="module")
def operated(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Operated]:
    folder = tmp_path_factory.mktemp("operated")
    port = free_port()
    environment = {**os.environ, "ROS_LOG_DIR": str(folder)}
    graph = subprocess.Popen(
        [sys.executable, str(Path(__file__).parent / "standing_graph.py"), NAMESPACE, str(folder)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment,
    )  # fmt: skip
    page = subprocess.Popen(
        [*COMMAND, "dashboard", "--namespace", NAMESPACE, "--port", str(port)], env=environment
    )
    motion = Motion(NAMESPACE)
    try:
        assert graph.stdout is not None
        assert graph.stdout.readline() == "READY\n"
        url = f"http://127.0.0.1:{port}/"
        until(lambda: page_answers(url))
        yield Operated(url=url, motion=motion)
    finally:
        motion.close()
        page.terminate()
        page.wait(30.0)
        assert graph.stdin is not None
        graph.stdin.close()
        graph.wait(60.0)


@dataclass(frozen=True, kw_only=True)
class ControlledPage:
    """The page of a made-up run, and its server."""

    url: str
    process: "subprocess.Popen[str]"


@contextmanager
def made_up_page(*arguments: str) -> Iterator[ControlledPage]:
    """Serve controlled_page.py until the end of the body."""
    port = free_port()
    process = subprocess.Popen(
        [sys.executable, str(Path(__file__).parent / "controlled_page.py"), str(port), *arguments],
        stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        url = f"http://127.0.0.1:{port}/"
        until(lambda: page_answers(url))
        yield ControlledPage(url=url, process=process)
    finally:
        process.terminate()
        process.wait(30.0)


@pytest.fixture(scope="module")
def controlled_page() -> Iterator[ControlledPage]:
    with made_up_page() as page:
        yield page


@pytest.fixture
def standing_page() -> Iterator[ControlledPage]:
    with made_up_page("standing") as page:
        yield page


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as launched:
        yield launched


@pytest.fixture(scope="module")
def new_tab(browser: Any) -> Iterator[Callable[[str, str], Tab]]:
    """Open tabs of the browser: at a desk or on a phone, at an address."""
    tabs = []

    def new(where: str, url: str) -> Tab:
        tabs.append(Tab(browser, SIZES[where]))
        tabs[-1].page.goto(url)
        return tabs[-1]

    yield new
    for tab in tabs:
        if not tab.page.is_closed():
            tab.page.close()
