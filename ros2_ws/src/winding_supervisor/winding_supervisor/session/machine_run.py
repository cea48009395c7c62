"""One run of a machine, followed until every node has dealt with its last sample."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Callable, Coroutine, Sequence
from typing import Any

from winding_recorder.live.run_buffer import RunBuffer
from winding_ros import topics
from winding_ros.graph import FEM, RIG
from winding_ros.topic import Topic
from winding_supervisor.machines.machine import Machine

# Messages may be lost at the very end of a run: nothing more comes after so long.
_LAST_MESSAGES = 1.0
# Stamps are whole nanoseconds.
_ROUNDING = 1e-6
_PROCESSED = (topics.JOINT_STATES, topics.FEM_MARKERS, topics.CORRECTED_MARKERS)
_TRACKED = (topics.CAMERA_INFO, topics.TRACKED_MARKERS)
# Topics come each in a stream of its own: the last picture may arrive after what was made of it.
_PUBLISHED = tuple(topic for topic in (*RIG.publishes, *FEM.publishes) if topic.rate)
_POLL = 0.05
_VIEW_PERIOD = 0.25

View = Callable[[RunBuffer, float], None]


class Completion:
    """Tells when each node has processed a run's last sample.

    Args:
        end: Stamp of the run's end [s].
        camera: Whether frames are tracked.
    """

    def __init__(self, end: float, *, camera: bool = True) -> None:
        self._end = end
        self._camera = camera
        self._last: list[float] | None = None
        self._since = math.inf

    def reached(self, buffer: RunBuffer, now: float) -> bool:
        """Return whether the buffer has everything, as far as wall time `now` [s] can tell."""
        if not all(self._ends(topic, buffer) for topic in _PROCESSED):
            return False
        heard = [topic for topic in _PUBLISHED if buffer.last_stamp(topic) >= 0.0]
        awaited = (*heard, *(_TRACKED if self._camera else ()))
        late = [topic for topic in awaited if not self._ends(topic, buffer)]
        if not late:
            return True
        # Frames may be tracked for long; what else is still to come is under way.
        last = [buffer.last_stamp(topic) for topic in late if topic in _TRACKED]
        if last != self._last:
            self._last, self._since = last, now
        return now - self._since >= _LAST_MESSAGES

    def _ends(self, topic: Topic, buffer: RunBuffer) -> bool:
        assert topic.rate is not None
        return buffer.last_stamp(topic) > self._end - 1.0 / topic.rate + _ROUNDING


class MachineRun:
    """Follows one run of a machine.

    Args:
        machine: What winds.
        buffer: Of the run.
        operated: Whether the machine begins when an operator wants; it is started here otherwise.
    """

    def __init__(self, machine: Machine, buffer: RunBuffer, *, operated: bool) -> None:
        self._machine, self._buffer, self._operated = machine, buffer, operated
        self._began: float | None = None
        self._over: float | None = None

    @property
    def begun(self) -> bool:
        """Whether the machine was started, or is waited for."""
        return self._began is not None

    @property
    def wall_s(self) -> float:
        """How long the run took, or has taken so far [s]."""
        if self._began is None:
            return 0.0
        return (self._over or time.monotonic()) - self._began

    async def follow(
        self, view: View, cut: Callable[[], bool], work: Sequence[Coroutine[Any, Any, None]]
    ) -> None:
        """Return when the run is over for every node.

        Args:
            view: Called a few times per second with the buffer and the wall time [s].
            cut: Returns whether the run is to end at once.
            work: What must go on meanwhile; when one of it fails, so does this.
        """
        starting = asyncio.create_task(self._begin())
        beside = [starting, *map(asyncio.create_task, work)]
        ending: Completion | None = None
        shown = -_VIEW_PERIOD
        try:
            while ending is None or not ending.reached(self._buffer, time.monotonic()):
                if cut():
                    break
                for task in beside:
                    if task.done():
                        task.result()
                if ending is None and starting.done() and self._machine.end is not None:
                    camera = topics.CAMERA_INFO in self._machine.sensors
                    ending = Completion(self._machine.end, camera=camera)
                now = time.monotonic()
                if now - shown >= _VIEW_PERIOD:
                    view(self._buffer, self.wall_s)
                    shown = now
                await asyncio.sleep(_POLL)
            view(self._buffer, self.wall_s)
        finally:
            for task in beside:
                task.cancel()
        self._over = time.monotonic()

    async def _begin(self) -> None:
        self._began = time.monotonic()
        if not self._operated:
            await self._machine.start()
        await self._machine.begun()
        self._began = time.monotonic()
