"""The graph's nodes as container engines keep them: each a process that is started again."""

import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from winding_ros.graph import GRAPH, NodeSpec


class KeptNodes:
    """One process per node, started again when it ends, until they are all taken down.

    Args:
        folder: Of their output.
        before: Command that runs a node's command in a place of its own, by number.
        environment: Beside that of the test.
        graph: The nodes.
    """

    namespace = "apart"

    def __init__(
        self,
        folder: Path,
        before: Callable[[int], list[str]] = lambda number: [],
        environment: dict[str, str] | None = None,
        graph: tuple[NodeSpec, ...] = GRAPH,
    ) -> None:
        self.down = threading.Event()
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self._folder = folder
        self._before = before
        self._environment = {**os.environ, "OMP_NUM_THREADS": "1", **(environment or {})}
        for number, spec in enumerate(graph):
            self._start(number, spec.name)
        self._keepers = [
            threading.Thread(target=self._keep, args=(number, spec.name))
            for number, spec in enumerate(graph)
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
                    *("-r", f"__ns:=/{self.namespace}", "-r", f"/clock:=/{self.namespace}/clock"),
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
def keep_nodes() -> Iterator[Callable[..., KeptNodes]]:
    """Make nodes that are kept until the end of the test."""
    kept: list[KeptNodes] = []

    def keep(*args: object, **kwargs: object) -> KeptNodes:
        kept.append(KeptNodes(*args, **kwargs))
        return kept[-1]

    yield keep
    for nodes in kept:
        nodes.close()
