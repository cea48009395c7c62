"""A session that cannot go on: its run is delivered, and its page stays."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from conducted_session import ConductedSession

from winding_core.status import RunPhase

pytestmark = [pytest.mark.processes, pytest.mark.timeout(900)]

NAMESPACE = "attended"


@pytest.fixture
def session(ros: Any, tmp_path: Path) -> Iterator[ConductedSession]:
    made = ConductedSession(ros, NAMESPACE, tmp_path / "runs", "--duration-s", "60")
    try:
        yield made
    finally:
        if made.process.poll() is None:
            made.end()


def test_the_page_outlives_a_machine_that_died(session: ConductedSession) -> None:
    session.until(session.served)
    session.until(lambda: session.call("rig/start").success)
    session.until(lambda: "WINDING" in session.page()["parts"]["band"])
    session.until(lambda: float(session.page()["texts"]["clock"].split()[0]) > 1.0)
    session.kill("winding_rig_node")
    session.reach(RunPhase.FAILED, message="winding_rig ended with exit code -9")
    session.until(lambda: "FAILED" in session.page()["parts"]["band"])
    assert session.page()["off"]["start"]
    session.until(lambda: "href=" in session.page()["parts"]["runs"])
    record = session.record(1)
    assert record["case"] == 4
    assert "winding_rig ended" in record["ended"]
    assert session.end() == 1
