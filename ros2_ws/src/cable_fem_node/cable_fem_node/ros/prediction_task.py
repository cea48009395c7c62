"""The rest of a run wound ahead beside the node's own thread."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator

from cable_fem_node.dynamics.failure import SolverError
from cable_fem_node.ros.background import BackgroundTask
from cable_fem_node.winding.replay import AbandonedError
from cable_fem_node.winding.run_ahead import RunAhead
from winding_core.markers import Markers


class PredictionTask:
    """Winds a run ahead in a thread of low priority; the owner asks for news when it likes.

    Args:
        ahead: What is left of it is wound.
        begun: Time from which it predicts [s].

    Attributes:
        begun: As given.
        failure: Why it ended before the run did; empty if it did not.
    """

    def __init__(self, ahead: RunAhead, begun: float) -> None:
        self.begun = begun
        self.failure = ""
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
