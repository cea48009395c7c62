"""`winding run --dashboard` conducted by services alone, as a controller of a cell does."""

import json
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

import psutil
from std_srvs.srv import Trigger

from winding_core.status import STATUS, RunPhase
from winding_ros import topics
from winding_ros.messages.diagnostics import decode_diagnostics

PATIENCE = 240.0


class ConductedSession:
    """The command, and what a cell's controller hears and asks of it."""

    def __init__(self, ros: Any, namespace: str, folder: Path, *options: str) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self._port = free.getsockname()[1]
        self.folder = folder
        self.process = subprocess.Popen(
            [sys.executable, "-m", "winding_cli.cli", "run", "--case", "4", "--dashboard",
             "--dashboard-port", str(self._port), "--namespace", namespace,
             "--output", str(folder), *options],
        )  # fmt: skip
        self._ros, self._namespace = ros, namespace
        self._node = ros.plain("controller")
        self.reported: dict[str, str] = {}
        topics.DIAGNOSTICS.subscribe(self._node, self._note)

    def _note(self, message: Any) -> None:
        for status in decode_diagnostics(message)[1]:
            if status.name == STATUS:
                self.reported = {"message": status.message, **status.values}

    def reach(self, phase: RunPhase, *, message: str = "") -> None:
        """Wait until the orchestrator reports a phase of the run."""

        def reached() -> bool:
            found = self.reported
            return found.get("phase") == phase.value and message in found.get("message", "")

        self.until(reached)

    def call(self, service: str) -> Any:
        """Call a service of the graph."""
        return self._ros.call(
            self._node, Trigger, f"/{self._namespace}/{service}", Trigger.Request()
        )

    def until(self, reached: Callable[[], bool]) -> None:
        """Wait for something while the command goes on."""
        end = time.monotonic() + PATIENCE
        while not reached():
            assert self.process.poll() is None
            assert time.monotonic() < end, self.reported
            self._ros.executor.spin_once(timeout_sec=0.05)

    def kill(self, package: str) -> None:
        """Kill a node's process."""
        children = psutil.Process(self.process.pid).children(recursive=True)
        (node,) = (child for child in children if package in child.cmdline())
        node.kill()

    def served(self) -> bool:
        """Return whether the operator's page answers."""
        try:
            self.page()
        except urllib.error.URLError:
            return False
        return True

    def page(self) -> dict[str, Any]:
        """Return what the operator's page shows."""
        url = f"http://127.0.0.1:{self._port}/snapshot"
        with urllib.request.urlopen(url, timeout=PATIENCE) as answer:
            shown: dict[str, Any] = json.load(answer)
        return shown

    def end(self) -> int:
        """Interrupt the command; return its exit code."""
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(PATIENCE)

    def record(self, number: int) -> Any:
        """Return the numbers of a run."""
        folder = self.folder if number == 1 else self.folder / f"run-{number}"
        return json.loads((folder / "run.json").read_text(encoding="utf-8"))
