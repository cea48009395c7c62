"""A real graph that waits for the operator, its page, and a real browser."""

import os
import select
import socket
import subprocess
import sys
import threading
import time
import urllib.request
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil
import pytest
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

from cable_winding.ros import topics
from cable_winding.ros.rig_messages import decode_joint_state

CHROMIUM = Path("/usr/bin/chromium")
# First starts compile kernels on a busy machine.
PATIENCE = 240.0
NAMESPACE = "operated"


class Motion:
    """The rig's newest encoder sample, looked at every few milliseconds: nothing queues up.

    Attributes:
        samples: Speed of the cylinder [rad/s] and the time of the look [s since the epoch].
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
    server: psutil.Process
    motion: Motion


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def wait_for_line(process: "subprocess.Popen[str]", text: str) -> None:
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        assert process.stdout is not None
        if select.select([process.stdout], [], [], 0.5)[0] and text in process.stdout.readline():
            return
        assert process.poll() is None, f"ended with {process.returncode} before it said {text}"
    pytest.fail(f"did not say {text} in {PATIENCE:g} s")


def wait_for_page(url: str) -> None:
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        try:
            urllib.request.urlopen(url, timeout=5.0).read()
        except OSError:
            time.sleep(0.1)
        else:
            return
    pytest.fail(f"no page at {url} in {PATIENCE:g} s")


@pytest.fixture(scope="module")
def duration(request: pytest.FixtureRequest) -> float:
    """Simulated length of the run [s]."""
    return float(getattr(request, "param", 60.0))


@pytest.fixture(scope="module")
def operated(tmp_path_factory: pytest.TempPathFactory, duration: float) -> Iterator[Operated]:
    folder = tmp_path_factory.mktemp("operated")
    port = free_port()
    environment = {**os.environ, "ROS_LOG_DIR": str(folder)}
    # pytest tells NiceGUI through these that it is being tested.
    for name in ("PYTEST_CURRENT_TEST", "NICEGUI_USER_SIMULATION", "NICEGUI_SCREEN_TEST_PORT"):
        environment.pop(name, None)
    graph = subprocess.Popen(
        [sys.executable, str(Path(__file__).parent / "standing_graph.py"), NAMESPACE, "4",
         str(duration), str(folder)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment,
    )  # fmt: skip
    page = subprocess.Popen(
        [sys.executable, "-m", "winding_bringup.cli", "dashboard", "--namespace", NAMESPACE,
         "--port", str(port)],
        env=environment,
    )  # fmt: skip
    motion = Motion(NAMESPACE)
    try:
        wait_for_line(graph, "READY")
        url = f"http://127.0.0.1:{port}/"
        wait_for_page(url)
        yield Operated(url=url, server=psutil.Process(page.pid), motion=motion)
    finally:
        motion.close()
        page.terminate()
        page.wait(30.0)
        assert graph.stdin is not None
        graph.stdin.close()
        graph.wait(60.0)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    if not CHROMIUM.exists():
        pytest.skip(f"no Chromium at {CHROMIUM}")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        launched = playwright.chromium.launch(
            executable_path=str(CHROMIUM),
            args=[
                "--no-sandbox",
                "--disable-gpu",
                "--use-angle=swiftshader",
                "--enable-unsafe-swiftshader",
                "--disable-background-networking",
            ],
        )
        yield launched
        launched.close()
