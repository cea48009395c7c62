"""`winding run --machine external --dashboard`: run after run, conducted by services alone."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from conducted_session import ConductedSession

from winding_core.run_phase import RunPhase

pytestmark = [pytest.mark.processes, pytest.mark.timeout(900)]

EXTERNAL = ("--machine", "external", "--no-camera", "--duration-s", "5")


@pytest.fixture
def session(ros: Any, driver: Any, tmp_path: Path) -> Iterator[ConductedSession]:
    made = ConductedSession(ros, driver.namespace, tmp_path / "runs", *EXTERNAL)
    try:
        yield made
    finally:
        if made.process.poll() is None:
            made.end()


def test_second_run_begins_where_the_machine_stands(
    session: ConductedSession, predicted_p1: float
) -> None:
    session.reach(RunPhase.READY)
    assert session.call("rig/start").success
    session.reach(RunPhase.UNDER_WAY)
    refused = session.call("orchestrator/next_run")
    assert not refused.success
    assert refused.message == "a run is under way; stop the machine first"
    session.reach(RunPhase.OVER)
    # Between two runs the nodes are not watched.
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
        # The machine's speeds are those of its encoder: the specification's 0.05 %.
        assert record["markers"][0]["s_fem_m"] == pytest.approx(predicted_p1, rel=5.0e-4)


SERVE = 'f"rig/{name}", getattr(self, name)'
UNSTOPPABLE = '"rig/" + ("no_" * ("stop" in name)) + name, getattr(self, name)'


@pytest.mark.parametrize("driver", [{SERVE: UNSTOPPABLE}], indirect=True)
def test_a_machine_that_cannot_be_stopped_at_its_end_is_reported(session: ConductedSession) -> None:
    session.reach(RunPhase.READY)
    assert session.call("rig/start").success
    session.reach(RunPhase.OVER, message="the stop could not be delivered: rig/stop has no server")
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
