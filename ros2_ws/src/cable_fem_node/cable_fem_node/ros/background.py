"""Work beside the node's own thread, at a lower priority: any task, a run wound ahead."""

import os
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Generic, TypeVar

from cable_fem_node.dynamics.state import SolverError
from cable_fem_node.winding.run_ahead import AbandonedError, RunAhead
from winding_core.markers import Markers

Result = TypeVar("Result")

# A third of the share of the process's other threads, and not starved on a busy machine.
_NICER, _NICEST = 5, 19


class BackgroundTask(Generic[Result]):
    """Runs a function in a thread of its own; the owner collects the result.

    Args:
        work: Receives a function that returns whether the result is still wanted, and raises
            once it is not.
    """

    def __init__(self, work: Callable[[Callable[[], bool]], Result]) -> None:
        self._unwanted = threading.Event()
        self._pool = ThreadPoolExecutor(1, "identification", _lower_priority)
        self._future = self._pool.submit(work, lambda: not self._unwanted.is_set())

    @property
    def done(self) -> bool:
        """Whether there is a result, or an error."""
        return self._future.done()

    def result(self) -> Result:
        """Return what the function returned, or raise what it raised."""
        self._pool.shutdown()
        return self._future.result()

    def abandon(self) -> None:
        """Ask the function to end, and wait until it has: at most one step of the rod."""
        self._unwanted.set()
        self._pool.shutdown()


def _lower_priority() -> None:
    if sys.platform == "linux":
        # Linux keeps a niceness per thread; a process that is nice itself may not become less so.
        thread = threading.get_native_id()
        present = os.getpriority(os.PRIO_PROCESS, thread)
        os.setpriority(os.PRIO_PROCESS, thread, min(present + _NICER, _NICEST))


class PredictionTask:
    """Winds a run ahead in a thread of low priority; the owner collects its results."""

    def __init__(self, ahead: RunAhead, begun: float) -> None:
        self.begun = begun
        self.failure = ""  # Why it ended before the run did; empty if it did not
        self._ahead = ahead
        self._found: deque[Markers] = deque()
        self._task: BackgroundTask[None] | None = BackgroundTask(self._wind)

    @property
    def reached(self) -> float:
        """Simulated time up to which the run has been wound ahead [s]."""
        return self._ahead.model.time

    def news(self) -> Iterator[Markers]:
        """Yield what has been found since the last call, in order."""
        task = self._task
        ended = task is not None and task.done
        while self._found:
            yield self._found.popleft()
        if task is not None and ended:
            self._task = None
            try:
                task.result()
            except (SolverError, ValueError) as error:
                self.failure = f"ended at t = {self.reached:.6g} s: {error}"

    def abandon(self) -> None:
        """End it; returns after at most one step of the rod."""
        if self._task is not None:
            self._task.abandon()
            self._task = None

    def _wind(self, going: Callable[[], bool]) -> None:
        try:
            for markers in self._ahead.wind_on(going):
                self._found.append(markers)
        except AbandonedError:
            return
