"""`winding run --machine external --dashboard`: run after run, conducted by services alone."""

import json
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest
from std_srvs.srv import Trigger

from winding_core.run_phase import STATUS, RunPhase
from winding_ros import topics
from winding_ros.diagnostic_messages import decode_diagnostics

pytestmark = [pytest.mark.processes, pytest.mark.timeout(900)]

PATIENCE = 240.0
DURATION = "5"


class Session:
    """The command, and what a cell's controller hears and asks of it."""

    def __init__(self, ros: Any, namespace: str, folder: Path) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        self.folder = folder
        self.process = subprocess.Popen(
            [sys.executable, "-m", "winding_cli.cli", "run", "--case", "4",
             "--machine", "external", "--no-camera", "--namespace", namespace,
             "--duration-s", DURATION, "--dashboard", "--dashboard-port", str(port),
             "--output", str(folder)],
        )  # fmt: skip
        self._ros, self._namespace = ros, namespace
        self._node = ros.plain("controller")
        self.said: dict[str, str] = {}
        topics.DIAGNOSTICS.subscribe(self._node, self._note)

    def _note(self, message: Any) -> None:
        for status in decode_diagnostics(message)[1]:
            if status.name == STATUS:
                self.said = {"message": status.message, **status.values}

    def reach(self, phase: RunPhase, *, message: str = "") -> None:
        """Wait until the orchestrator says that a run is so far."""
        self._until(
            lambda: (
                self.said.get("phase") == phase.value and message in self.said.get("message", "")
            )
        )

    def call(self, service: str) -> Any:
        """Call a service of the graph."""
        return self._ros.call(
            self._node, Trigger, f"/{self._namespace}/{service}", Trigger.Request()
        )

    def _until(self, reached: Callable[[], bool]) -> None:
        end = time.monotonic() + PATIENCE
        while not reached():
            assert self.process.poll() is None
            assert time.monotonic() < end, self.said
            self._ros.executor.spin_once(timeout_sec=0.05)

    def kill(self, package: str) -> None:
        """Kill a node's process."""
        children = psutil.Process(self.process.pid).children(recursive=True)
        (node,) = (child for child in children if package in child.cmdline())
        node.kill()

    def end(self) -> int:
        """Interrupt the command; return its exit code."""
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(PATIENCE)

    def record(self, number: int) -> Any:
        """Return the numbers of a run."""
        folder = self.folder if number == 1 else self.folder / f"run-{number}"
        return json.loads((folder / "run.json").read_text(encoding="utf-8"))


@pytest.fixture
def session(ros: Any, driver: Any, tmp_path: Path) -> Iterator[Session]:
    made = Session(ros, driver.namespace, tmp_path / "runs")
    try:
        yield made
    finally:
        if made.process.poll() is None:
            made.end()


def test_second_run_begins_where_the_machine_stands(session: Session, predicted_p1: float) -> None:
    session.reach(RunPhase.READY)
    assert session.call("rig/start").success
    session.reach(RunPhase.UNDER_WAY)
    refused = session.call("orchestrator/next_run")
    assert not refused.success
    assert refused.message == "a run is under way; stop the machine first"
    session.reach(RunPhase.OVER)
    # Nobody watches the nodes between two runs.
    session.kill("cable_fem_node")
    assert session.call("orchestrator/next_run").success
    session.reach(RunPhase.READY)
    assert session.call("rig/start").success
    session.reach(RunPhase.UNDER_WAY)
    session.reach(RunPhase.OVER)
    assert session.end() == 0
    for number in (1, 2):
        record = session.record(number)
        assert record["ended"] is None
        # The machine's speeds are what its encoder says: the specification's 0.05 %.
        assert record["markers"][0]["s_fem_m"] == pytest.approx(predicted_p1, rel=5.0e-4)


SERVE = 'f"rig/{name}", getattr(self, name)'
UNSTOPPABLE = '"rig/" + ("no_" * ("stop" in name)) + name, getattr(self, name)'


@pytest.mark.parametrize("driver", [{SERVE: UNSTOPPABLE}], indirect=True)
def test_a_machine_that_cannot_be_stopped_at_its_end_is_said(session: Session) -> None:
    session.reach(RunPhase.READY)
    assert session.call("rig/start").success
    session.reach(RunPhase.OVER, message="the stop could not be delivered: nobody serves rig/stop")
    assert session.end() == 0
    assert session.record(1)["ended"] is None


RESET = """        self.goal, self.latched, response.success = 0.0, False, True
        return response
"""
REFUSED_ONCE = """        first, self.asked = not hasattr(self, "asked"), True
        self.goal, self.latched, response.success = 0.0, False, not first
        response.message = "the door is open" if first else ""
        return response
"""


@pytest.mark.parametrize("driver", [{RESET: REFUSED_ONCE}], indirect=True)
def test_a_reset_that_is_refused_is_said_and_asked_again(session: Session) -> None:
    session.reach(RunPhase.READY)
    assert session.call("orchestrator/next_run").success
    session.reach(RunPhase.OVER, message="no next run: rig/reset was refused: the door is open")
    assert session.call("orchestrator/next_run").success
    session.reach(RunPhase.READY)
    assert session.end() == 0
    # Nothing was wound.
    assert not (session.folder / "run.json").exists()
