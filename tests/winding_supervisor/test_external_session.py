"""`winding run --dashboard`, conducted by services alone, run after run."""

import json
import math
import signal
import subprocess
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from std_srvs.srv import Trigger

from processes import COMMAND, PATIENCE, child_of, free_port
from winding_core.status import MACHINE_STATUS, STATUS, RunPhase
from winding_dashboard.page.cell import DASH
from winding_ros import topics
from winding_ros.messages.diagnostics import decode_diagnostics

pytestmark = [pytest.mark.processes, pytest.mark.timeout(900)]

EXTERNAL = ("--machine", "external", "--no-camera", "--duration-s", "5")
SERVE = 'f"rig/{name}", getattr(self, name)'
UNSTOPPABLE = '"rig/" + ("no_" * ("stop" in name)) + name, getattr(self, name)'
RESET = """        self.goal, self.latched, response.success = 0.0, False, True
        return response
"""
REFUSED_ONCE = """        first, self.asked = not hasattr(self, "asked"), True
        self.goal, self.latched, response.success = 0.0, False, not first
        response.message = "the door is open" if first else ""
        return response
"""
LIMIT = 0.2  # Of a length [%]: less than the correction leaves of case 4


class ConductedSession:
    """The command, and what a cell's controller hears and asks of it."""

    def __init__(self, ros: Any, namespace: str, folder: Path, *options: str) -> None:
        self._port = free_port()
        self.folder = folder
        self.process = subprocess.Popen(
            [*COMMAND, "run", "--case", "4", "--dashboard",
             "--dashboard-port", str(self._port), "--namespace", namespace,
             "--output", str(folder), *options],
        )  # fmt: skip
        self._ros, self._namespace = ros, namespace
        self._node = ros.plain("controller")
        self.reported: dict[str, str] = {}
        self.risk = ""
        topics.DIAGNOSTICS.subscribe(self._node, self._note)

    def _note(self, message: Any) -> None:
        for status in decode_diagnostics(message)[1]:
            if status.name == STATUS:
                self.reported = {"message": status.message, **status.values}
            elif status.name == MACHINE_STATUS:
                self.risk = status.message

    def reach(self, phase: RunPhase, *, message: str = "") -> None:
        """Wait until the orchestrator reports a phase of the run."""

        def reached() -> bool:
            found = self.reported
            return found.get("phase") == phase.value and message in found.get("message", "")

        self.until(reached)

    def call(self, service: str) -> Any:
        return self._ros.call(
            self._node, Trigger, f"/{self._namespace}/{service}", Trigger.Request()
        )

    def until(self, reached: Callable[[], bool]) -> None:
        end = time.monotonic() + PATIENCE
        while not reached():
            assert self.process.poll() is None
            assert time.monotonic() < end, self.reported
            self._ros.executor.spin_once(timeout_sec=0.05)

    def kill(self, package: str) -> None:
        child_of(self.process, package).kill()

    def served(self) -> bool:
        try:
            self.page()
        except urllib.error.URLError:
            return False
        return True

    def page(self) -> dict[str, Any]:
        url = f"http://127.0.0.1:{self._port}/snapshot"
        with urllib.request.urlopen(url, timeout=PATIENCE) as answer:
            shown: dict[str, Any] = json.load(answer)
        return shown

    def run_time(self) -> float:
        """Return the time of the run on the page [s]; nan before the first sample is shown."""
        shown = self.page()["texts"]["clock"].removesuffix(" s")
        return math.nan if shown == DASH else float(shown)

    def set_limit(self, percent: float) -> None:
        """Set what counts as good, as an operator does on the page."""
        seen, limits = self.page(), {"error_limit_pct": percent}
        body = {"server": seen["server"], "sequence": seen["sequence"], "limits": limits}
        url = f"http://127.0.0.1:{self._port}/limits"
        head = {"Content-Type": "application/json"}
        asked = urllib.request.Request(url, json.dumps(body).encode(), head)
        with urllib.request.urlopen(asked, timeout=PATIENCE) as answer:
            assert not json.load(answer)["refused"]

    def end(self) -> int:
        """Interrupt the command; return its exit code."""
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(PATIENCE)

    def failed_stops(self) -> int:
        """Return how often the machine was asked to stop in vain."""
        return (self.folder / "events.jsonl").read_text(encoding="utf-8").count('"not stopped"')

    def record(self, number: int) -> Any:
        folder = self.folder if number == 1 else self.folder / f"run-{number}"
        return json.loads((folder / "run.json").read_text(encoding="utf-8"))


@contextmanager
def conducted(*words: Any) -> Iterator[ConductedSession]:
    made = ConductedSession(*words)
    try:
        yield made
    finally:
        if made.process.poll() is None:
            made.end()


@pytest.fixture
def session(ros: Any, driver: Any, tmp_path: Path) -> Iterator[ConductedSession]:
    with conducted(ros, driver.namespace, tmp_path / "runs", *EXTERNAL) as made:
        yield made


@pytest.mark.campaign
def test_each_run_begins_where_the_machine_stands_and_has_its_limits(
    session: ConductedSession, predicted_p1: float
) -> None:
    session.reach(RunPhase.READY)
    assert session.call("rig/start").success
    session.reach(RunPhase.UNDER_WAY)
    refused = session.call("orchestrator/next_run")
    assert not refused.success
    assert refused.message == "a run is under way; stop the machine first"
    session.reach(RunPhase.OVER)
    session.until((session.folder / "run.json").exists)
    session.until(lambda: "the run is over" in session.page()["parts"]["band"])
    assert session.run_time() < 60.0
    session.set_limit(LIMIT)
    # Between two runs the nodes are not watched.
    session.kill("cable_fem_node")
    assert session.call("orchestrator/next_run").success
    session.reach(RunPhase.READY)
    assert session.call("rig/start").success
    session.reach(RunPhase.UNDER_WAY)
    session.reach(RunPhase.OVER)
    # A run that is broken off is over as soon as the operator wants the next one.
    session.until(lambda: session.call("orchestrator/next_run").success)
    session.reach(RunPhase.READY)
    assert session.call("rig/start").success
    session.reach(RunPhase.UNDER_WAY)
    assert session.call("rig/emergency_stop").success
    session.until(lambda: session.call("orchestrator/next_run").success)
    session.reach(RunPhase.READY)
    assert session.end() == 0
    records = [session.record(number) for number in (1, 2, 3)]
    assert [record["ended"] for record in records] == [None, None, "reset by the operator"]
    assert [record["error_verdict"]["limit_pct"] for record in records] == [4.8, LIMIT, LIMIT]
    assert len({record["identity"]["run_id"] for record in records}) == 3
    for record in records[:2]:
        # The machine's speeds are those of its encoder: the specification's 0.05 %.
        assert record["markers"][0]["s_fem_m"] == pytest.approx(predicted_p1, rel=5.0e-4)


def test_a_start_as_soon_as_the_page_is_served_begins_the_run(session: ConductedSession) -> None:
    session.until(session.served)
    assert session.call("rig/start").success
    session.reach(RunPhase.OVER)
    assert session.end() == 0
    assert session.record(1)["ended"] is None


@pytest.mark.parametrize("driver", [{SERVE: UNSTOPPABLE}], indirect=True)
def test_a_machine_that_cannot_be_stopped_at_its_end_is_reported(session: ConductedSession) -> None:
    session.reach(RunPhase.READY)
    assert session.call("rig/start").success
    session.reach(RunPhase.OVER)
    session.until(lambda: session.risk.startswith("THE MACHINE still turns: the stop could not"))
    session.until((session.folder / "run.json").exists)
    outcome = session.record(1)["outcome"]
    assert (outcome["machine"], outcome["verdict"]) == ("turning", "failed")
    # The session ends, asks the machine to stop again, and leaves it to whoever confirms that.
    asked = session.failed_stops()
    session.process.send_signal(signal.SIGINT)
    session.until(lambda: session.failed_stops() >= asked + 3)
    assert session.end() == 1


@pytest.mark.parametrize("driver", [{RESET: REFUSED_ONCE}], indirect=True)
def test_a_reset_that_is_refused_is_reported_and_asked_again(session: ConductedSession) -> None:
    session.reach(RunPhase.READY)
    assert session.call("orchestrator/next_run").success
    session.reach(RunPhase.OVER, message="no next run: rig/reset was refused: the door is open")
    assert session.call("orchestrator/next_run").success
    session.reach(RunPhase.READY)
    assert session.end() == 0
    # Nothing was wound.
    assert not (session.folder / "run.json").exists()


@pytest.mark.parametrize("driver", [{"[self.angle, self": "[-self.angle, self"}], indirect=True)
def test_a_session_that_cannot_go_on_refuses_the_next_run(session: ConductedSession) -> None:
    session.reach(RunPhase.READY)
    assert session.call("rig/start").success
    session.reach(RunPhase.FAILED, message="the cylinder turned backwards")
    refused = session.call("orchestrator/next_run")
    assert (refused.success, refused.message) == (False, "the session cannot go on")
    session.until(lambda: "FAILED" in session.page()["parts"]["band"])
    assert session.page()["off"]["reset"]
    session.until(lambda: "href=" in session.page()["parts"]["runs"])
    assert session.end() == 1
    assert "the cylinder turned backwards" in session.record(1)["ended"]


def test_the_page_outlives_a_simulated_machine_that_died(ros: Any, tmp_path: Path) -> None:
    with conducted(ros, "attended", tmp_path / "runs", "--duration-s", "60") as session:
        session.until(session.served)
        session.until(lambda: session.call("rig/start").success)
        session.until(lambda: "WINDING" in session.page()["parts"]["band"])
        session.until(lambda: session.run_time() > 1.0)
        session.kill("winding_rig_node")
        session.reach(RunPhase.FAILED, message="winding_rig ended with exit code -9")
        session.until(lambda: "FAILED" in session.page()["parts"]["band"])
        assert session.page()["off"]["start"]
        session.until(lambda: "href=" in session.page()["parts"]["runs"])
        record = session.record(1)
        assert record["case"] == 4
        assert "winding_rig ended" in record["ended"]
        assert session.end() == 1
