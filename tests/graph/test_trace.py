"""`winding run --trace` on nodes of which two are slow on purpose."""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from winding_ros.graph import CORRECTION, GRAPH, TRACKER

pytestmark = pytest.mark.processes

NAMESPACE = "slowed"
# Seconds that a message of a topic takes longer; frames come every 50 ms at a tenth of real time.
SLOW = {
    TRACKER.name: ("camera/image_raw", 0.025),
    CORRECTION.name: ("fem/markers", 0.04),
}


@pytest.fixture
def nodes() -> Iterator[list[subprocess.Popen[bytes]]]:
    started = []
    for spec in GRAPH:
        command = ["-m", spec.package]
        if spec.name in SLOW:
            topic, seconds = SLOW[spec.name]
            slowed = Path(__file__).with_name("slowed_node.py")
            command = [str(slowed), spec.package, topic, str(seconds)]
        started.append(
            subprocess.Popen(
                [
                    *(sys.executable, *command, "--ros-args", "-r", f"__ns:=/{NAMESPACE}"),
                    *("-r", f"/clock:=/{NAMESPACE}/clock"),
                ],
                env={**os.environ, "OMP_NUM_THREADS": "1"},
            )
        )
    yield started
    for process in started:
        process.kill()
        process.wait()


def test_two_slow_nodes_are_blamed_on_their_own_hops(
    nodes: Any, tmp_path: Path, command: Callable[..., Any]
) -> None:
    done = command(
        *("run", "--attach", "--namespace", NAMESPACE, "--case", 4, "--duration-s", 1),
        *("--speed", 0.1, "--output", "run", "--trace", "trace.json"),
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    trace = json.loads((tmp_path / "run" / "run.json").read_text())["trace"]
    assert trace["lengths"] == 51
    camera = {(cost["station"], cost["hop"]): cost for cost in trace["camera"]}
    whole = camera.pop((None, "whole"))
    # Each hop begins where the one before it ends, so that only rounding is left.
    assert sum(cost["share"] for cost in camera.values()) == pytest.approx(whole["share"], rel=1e-9)
    slow = {("tracker", "measure"): 0.025, ("correction", "compute"): 0.04}
    for hop, seconds in slow.items():
        assert camera[hop]["median_s"] >= seconds
    # Waiting aside: predictions come every 200 ms, and a slow reader makes queues.
    work = {
        hop: cost
        for hop, cost in camera.items()
        if hop[1] not in ("wait for prediction", "wait for encoder", "queue")
    }
    blamed = sorted(work, key=lambda hop: work[hop]["median_s"])[-2:]
    assert set(blamed) == set(slow)
    events = json.loads((tmp_path / "trace.json").read_text())["traceEvents"]
    assert sum(event["ph"] == "X" for event in events) > 51
    report = (tmp_path / "run" / "report" / "index.html").read_text()
    assert "Where a corrected length" in report
