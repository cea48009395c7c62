"""`winding run --attach` on nodes that somebody else started, as containers do."""

import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from winding_bringup.event_log import read_events
from winding_bringup.graph import GRAPH

pytestmark = [pytest.mark.processes, pytest.mark.xdist_group("containers")]

NAMESPACE = "apart"


class Containers:
    """One process per node, started again when it ends, until they are all taken down.

    Args:
        folder: Of their output.
        before: Command that runs a node's command in a place of its own, by number.
        environment: Beside that of the test.
    """

    def __init__(
        self,
        folder: Path,
        before: Callable[[int], list[str]] = lambda number: [],
        environment: dict[str, str] | None = None,
    ) -> None:
        self.down = threading.Event()
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self._folder = folder
        self._before = before
        self._environment = {**os.environ, "OMP_NUM_THREADS": "1", **(environment or {})}
        for number, spec in enumerate(GRAPH):
            self._start(number, spec.name)
        self._keepers = [
            threading.Thread(target=self._keep, args=(number, spec.name))
            for number, spec in enumerate(GRAPH)
        ]
        for keeper in self._keepers:
            keeper.start()

    def close(self) -> None:
        self.down.set()
        for process in self.processes.values():
            process.terminate()
        for keeper in self._keepers:
            keeper.join()

    def _start(self, number: int, name: str) -> None:
        package = next(spec.package for spec in GRAPH if spec.name == name)
        with (self._folder / f"{name}.log").open("ab") as output:
            self.processes[name] = subprocess.Popen(
                [
                    *self._before(number),
                    *(sys.executable, "-m", package, "--ros-args"),
                    *("-r", f"__ns:=/{NAMESPACE}", "-r", f"/clock:=/{NAMESPACE}/clock"),
                ],
                stdout=output,
                stderr=output,
                env=self._environment,
            )

    def _keep(self, number: int, name: str) -> None:
        while True:
            self.processes[name].wait()
            if self.down.is_set():
                return
            self._start(number, name)


@pytest.fixture
def containers(tmp_path: Path) -> Iterator[Containers]:
    apart = Containers(tmp_path)
    yield apart
    apart.close()


def test_two_runs_of_one_set_of_nodes(
    containers: Containers, tmp_path: Path, command: Callable[..., Any]
) -> None:
    for case in (4, 8):
        done = command(
            *("run", "--attach", "--namespace", NAMESPACE, "--case", case, "--speed", 0),
            *("--duration-s", 4, "--output", f"case{case}", "--json", f"case{case}.json"),
            cwd=tmp_path,
        )
        assert done.returncode == 0, done.stderr
        assert json.loads((tmp_path / f"case{case}.json").read_text())["case"] == case
    health = command("health", "--namespace", NAMESPACE, "--patience-s", 60, cwd=tmp_path)
    assert health.returncode == 0, health.stderr
    # Nobody ended or started a node between the runs.
    assert all(process.poll() is None for process in containers.processes.values())


def test_a_node_that_its_keeper_starts_again_winds_on(
    containers: Containers, tmp_path: Path
) -> None:
    run = subprocess.Popen(
        [
            *(sys.executable, "-m", "winding_bringup.cli", "run", "--attach", "--case", "4"),
            *("--namespace", NAMESPACE, "--duration-s", "8", "--output", "run"),
        ],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert run.stderr is not None
    for line in run.stderr:
        if "simulated" in line:
            break
    containers.processes["correction"].kill()
    _, said = run.communicate(timeout=240)
    assert run.returncode == 0, said
    told = [event.what for event in read_events(tmp_path / "run" / "events.jsonl")]
    assert told == ["detected", "stopped", "standing", "restarting", "restarted", "resumed"]


def test_a_refused_parameter_is_said_by_name(
    containers: Containers, tmp_path: Path, command: Callable[..., Any]
) -> None:
    parameters = tmp_path / "own.yaml"
    parameters.write_text("/**/cable_fem:\n  ros__parameters: {no_such_parameter: 1}\n")
    done = command(
        *("run", "--attach", "--namespace", NAMESPACE, "--case", 4, "--duration-s", 1),
        *("--parameters", parameters),
        cwd=tmp_path,
    )
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith("winding: cable_fem: ")
    assert "no_such_parameter" in done.stderr
