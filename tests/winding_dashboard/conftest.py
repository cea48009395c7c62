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
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from browser_tab import Tab
from chromium import chromium
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

from processes import COMMAND, PATIENCE, Served, serving
from winding_ros import topics
from winding_ros.messages.diagnostics import decode_diagnostics
from winding_ros.messages.rig import decode_joint_state

SIZES = {"desk": (1280, 800), "phone": (390, 844)}
NAMESPACE = "operated"
HERE = Path(__file__).parent


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
def operated(
    tmp_path_factory: pytest.TempPathFactory, motion_of: Callable[[str], Motion]
) -> Iterator[Operated]:
    folder = tmp_path_factory.mktemp("operated")
    environment = {**os.environ, "ROS_LOG_DIR": str(folder)}
    words = (*COMMAND, "dashboard", "--namespace", NAMESPACE, "--port")
    with (
        subprocess.Popen(
            [sys.executable, HERE / "standing_graph.py", NAMESPACE, folder],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment,
        ) as graph,
        serving(*words, env=environment) as page,
    ):  # fmt: skip
        assert graph.stdout.readline() == "READY\n"
        yield Operated(url=page.url, motion=motion_of(NAMESPACE))


@pytest.fixture(scope="module")
def controlled_page() -> Iterator[Served]:
    with serving(sys.executable, HERE / "controlled_page.py") as page:
        yield page


@pytest.fixture
def standing_page() -> Iterator[Served]:
    with serving(sys.executable, HERE / "controlled_page.py", "standing") as page:
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
