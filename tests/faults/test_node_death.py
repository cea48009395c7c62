"""A node dies, or a person interrupts: everything stops, is named, and is kept."""

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from interrupted_run import STAGES, interrupt
from rosbags.highlevel import AnyReader

from winding_ros.runtime.process import SUPERVISED

pytestmark = [
    pytest.mark.campaign,
    pytest.mark.processes,
    pytest.mark.timeout(900),
]

PATIENCE = 600.0


class Winding:
    """A `winding run` in the background, recorded."""

    def __init__(self, folder: Path) -> None:
        self.bag = folder / "bag"
        self.log = folder / "run" / "log"
        self._stderr = folder / "stderr"
        with self._stderr.open("w") as stderr:
            self.process = subprocess.Popen(
                [
                    sys.executable, "-m", "winding_cli.cli", "run", "--case", "4",
                    "--output", folder / "run", "--bag", self.bag,
                ],
                cwd=folder,
                stdout=subprocess.DEVNULL,
                stderr=stderr,
            )  # fmt: skip

    def said(self) -> str:
        return self._stderr.read_text(encoding="utf-8")

    def wait_until_it_winds(self) -> None:
        # The first progress line comes after a tenth of the run.
        end = time.monotonic() + PATIENCE
        while " simulated, " not in self.said():
            assert self.process.poll() is None, self.said()
            assert time.monotonic() < end, "the run does not begin"
            time.sleep(0.05)

    def node(self, package: str) -> int:
        """Return the process id of a node of this run."""
        for entry in Path("/proc").iterdir():
            if not entry.name.isdecimal():
                continue
            try:
                words = (entry / "cmdline").read_bytes().decode().split("\0")
            except (FileNotFoundError, ProcessLookupError):
                continue
            if package in words and any(str(self.log) in word for word in words):
                return int(entry.name)
        raise LookupError(f"no process of {package}")

    def nodes_left(self) -> int:
        count = 0
        for package in ("cable_fem_node", "marker_tracker_node", "winding_rig_node"):
            try:
                self.node(package)
            except LookupError:
                continue
            count += 1
        return count


@pytest.fixture
def winding_run(tmp_path: Path) -> Iterator[Winding]:
    run = Winding(tmp_path)
    yield run
    if run.process.poll() is None:
        run.process.kill()
    run.process.wait()


def messages_in(bag: Path) -> int:
    with AnyReader([bag]) as reader:
        return sum(1 for _ in reader.messages())


def test_dead_node_is_named_and_the_recording_kept(winding_run: Winding) -> None:
    winding_run.wait_until_it_winds()
    os.kill(winding_run.node("winding_rig_node"), signal.SIGKILL)
    assert winding_run.process.wait(PATIENCE) == 1
    assert "winding: winding_rig ended with exit code -9" in winding_run.said()
    assert "of simulated time" in winding_run.said()
    assert winding_run.nodes_left() == 0
    # Two simulated seconds have at least two thousand encoder samples.
    assert messages_in(winding_run.bag) > 2000


def test_interrupted_run_stops_its_nodes_and_keeps_the_recording(winding_run: Winding) -> None:
    winding_run.wait_until_it_winds()
    winding_run.process.send_signal(signal.SIGTERM)
    assert winding_run.process.wait(PATIENCE) == 130
    assert "interrupted; the nodes are stopped" in winding_run.said()
    assert winding_run.nodes_left() == 0
    assert messages_in(winding_run.bag) > 2000


def interrupted_twice(times: int) -> list[str]:
    """Return what runs left behind that were interrupted twice at moments of every stage."""
    domain = int(os.environ["ROS_DOMAIN_ID"])
    draw = random.Random(1)
    ways = [(signal.SIGTERM, False), (signal.SIGINT, True), (signal.SIGINT, False)]
    return [
        f"{stage}, {number.name}: {fault}"
        for stage, longest in STAGES.items()
        for k in range(times)
        for number, group in [ways[k % len(ways)]]
        for fault in interrupt(
            stage, number, group=group, delay=draw.uniform(0.0, longest), domain=domain
        )
    ]


def test_run_that_is_interrupted_twice_leaves_nothing_behind() -> None:
    assert interrupted_twice(times=1) == []


@pytest.mark.soak
@pytest.mark.timeout(7200)
def test_run_that_is_interrupted_twice_at_any_moment_leaves_nothing_behind() -> None:
    assert interrupted_twice(times=30) == []


def test_node_ends_when_its_supervisor_died_while_it_started(tmp_path: Path) -> None:
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    node = subprocess.run(
        [sys.executable, "-m", "correction_node", "--ros-args", "-r", "__ns:=/orphan"],
        cwd=tmp_path,
        env={**os.environ, SUPERVISED: str(gone.pid)},
        timeout=PATIENCE,
        check=False,
    )
    assert node.returncode == 0
