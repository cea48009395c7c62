"""`winding run --attach` on nodes of other processes, as with containers."""

import json
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from processes import COMMAND
from winding_supervisor.watch.event_log import read_events

pytestmark = [pytest.mark.campaign, pytest.mark.processes]


@pytest.fixture
def containers(keep_nodes: Callable[..., Any], tmp_path: Path) -> Any:
    return keep_nodes(tmp_path)


def test_two_runs_of_one_set_of_nodes(containers: Any, tmp_path: Path, command: Any) -> None:
    for case in (4, 8):
        command(
            *("run", "--attach", "--namespace", containers.namespace, "--case", case, "--speed", 0),
            *("--duration-s", 4, "--output", f"case{case}", "--json", f"case{case}.json"),
            cwd=tmp_path,
            code=0,
        )
        assert json.loads((tmp_path / f"case{case}.json").read_text())["case"] == case
    command("health", "--namespace", containers.namespace, "--patience-s", 60, cwd=tmp_path, code=0)
    # No node was ended or started between the runs.
    assert all(process.poll() is None for process in containers.processes.values())


def test_a_node_that_its_keeper_starts_again_winds_on(containers: Any, tmp_path: Path) -> None:
    run = subprocess.Popen(
        [
            *(*COMMAND, "run", "--attach", "--case", "4"),
            *("--namespace", containers.namespace, "--duration-s", "8", "--output", "run"),
        ],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        text=True,
    )
    for line in run.stderr:
        if "simulated" in line:
            break
    containers.processes["correction"].kill()
    _, printed = run.communicate(timeout=240)
    assert run.returncode == 0, printed
    events = [event.what for event in read_events(tmp_path / "run" / "events.jsonl")]
    assert events == ["detected", "stopped", "standing", "restarting", "restarted", "resumed"]
