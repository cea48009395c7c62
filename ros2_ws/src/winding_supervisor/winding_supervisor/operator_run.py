"""A run that an operator starts, stops and ends; nothing here moves the machine."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Callable, Coroutine, Iterable, Mapping
from typing import Any

from rclpy.serialization import deserialize_message

from winding_core.status import Status
from winding_recorder.bags.notes import PARAMETERS
from winding_recorder.live.recorder import BufferedMessage, Recorder, RunBuffer
from winding_ros import topics
from winding_ros.async_client import AsyncClient
from winding_ros.message_error import MessageError
from winding_ros.rig_messages import decode_joint_state
from winding_supervisor.completion import Completion
from winding_supervisor.orchestrator import Orchestrator

_POLL = 0.05
_VIEW_PERIOD = 0.25
_FINISHED, _WINDING = "finished", "winding"
# A machine that begins anew stands at angle zero; an encoder trembles by far less [rad].
_FELL_BACK = 0.1


class RunStart:
    """Notices that the encoders stand where they stood before a run: another one has begun."""

    def __init__(self) -> None:
        self._last: tuple[int, float] | None = None

    def look(self, buffer: RunBuffer) -> bool:
        """Return whether a further run has begun since the last look."""
        message = buffer.last(topics.JOINT_STATES)
        now = None if message is None else _place(message)
        if now is None:
            return False
        before, self._last = self._last, now
        return before is not None and (now[0] < before[0] or now[1] < before[1] - _FELL_BACK)

    @staticmethod
    def cut(buffer: RunBuffer) -> tuple[int, float]:
        """Return when the newest run began: arrival, monotonic [ns], and simulated time [s]."""
        later: BufferedMessage | None = None
        place = (0, 0.0)
        for message in reversed(buffer.messages[topics.JOINT_STATES.name]):
            here = _place(message)
            if here is None:
                continue
            if later is not None and (here[0] > place[0] or here[1] > place[1] + _FELL_BACK):
                period = round(1e9 / (topics.JOINT_STATES.rate or 1.0))
                # Time goes on over a reset and begins at zero with a machine that is built anew.
                origin = later.stamp_ns - period if place[0] > here[0] else 0
                return (message.received_ns + later.received_ns) // 2, max(origin, 0) * 1e-9
            later, place = message, here
        return 0, 0.0


def _place(message: BufferedMessage) -> tuple[int, float] | None:
    """Return stamp [ns] and angle of the cylinder [rad]; None for a sample that says nothing."""
    try:
        _, reading = decode_joint_state(deserialize_message(message.data, topics.JOINT_STATES.type))
    except MessageError:
        return None
    return message.stamp_ns, reading.cylinder_angle


class OperatorRun:
    """Follows what an operator does with the machine until a run is finished or ended.

    The operator may prepare another condition, start, stop, reset and stop in an emergency, as
    often as they like. The buffer keeps the last run alone.

    Args:
        client: The orchestrator's node.
        orchestrator: Learns what the nodes are set to, for those that it restarts.
        recorder: Its buffer and its notes.
        ended: Is set when the operator ends the session.

    Attributes:
        wound: Parameters of the machine in the last run; nothing while none was begun.
    """

    def __init__(
        self,
        client: AsyncClient,
        orchestrator: Orchestrator,
        recorder: Recorder,
        ended: asyncio.Event,
    ) -> None:
        self.wound: dict[str, object] = {}
        self._client = client
        self._orchestrator = orchestrator
        self._recorder = recorder
        self._ended = ended
        self._phase: str | None = None
        self._start = RunStart()
        self._ending: Completion | None = None
        self._begun: float | None = None
        self._over: float | None = None
        self._reading: asyncio.Task[None] | None = None

    @property
    def wall_s(self) -> float:
        """How long the last run has taken [s]."""
        if self._begun is None:
            return 0.0
        return (self._over or time.monotonic()) - self._begun

    async def follow(
        self, work: Iterable[Coroutine[Any, Any, None]], view: Callable[[RunBuffer, float], None]
    ) -> None:
        """Return when a run is finished and dealt with, or ended by the operator.

        Args:
            work: What must go on meanwhile; when one of it fails, so does this.
            view: Called a few times per second with the buffer and the wall time [s].
        """
        buffer = self._recorder.buffer
        beside = [asyncio.create_task(item) for item in work]
        shown = time.monotonic() - _VIEW_PERIOD
        try:
            while not self._ended.is_set() and not self._finished():
                for task in beside:
                    if task.done():
                        task.result()
                self._notice()
                if time.monotonic() - shown >= _VIEW_PERIOD:
                    view(buffer, self.wall_s)
                    shown = time.monotonic()
                await asyncio.sleep(_POLL)
            self._over = time.monotonic()
            if self._reading is not None:
                await self._reading
        finally:
            for task in (*beside, *([self._reading] if self._reading else [])):
                task.cancel()

    def _finished(self) -> bool:
        return self._ending is not None and self._ending.reached(
            self._recorder.buffer, time.monotonic()
        )

    def _notice(self) -> None:
        """Look at what the operator has made of the machine since the last look."""
        if self._start.look(self._recorder.buffer):
            self._recorder.buffer.begin_anew(*RunStart.cut(self._recorder.buffer))
            self._begun, self._ending = time.monotonic(), None
        status = self._client.status(topics.RIG) or Status(name=topics.RIG)
        phase = status.values.get("phase")
        if phase == self._phase:
            return
        known, self._phase = self._phase is not None, phase
        if phase == _WINDING and self._begun is None:
            self._begun = time.monotonic()
        self._ending = Completion(float(status.values["time"])) if phase == _FINISHED else None
        # Another condition may have been prepared, or parameters set by hand.
        if phase is not None and (phase == _WINDING or not known):
            self._read(wound=phase == _WINDING)

    def _read(self, *, wound: bool) -> None:
        before = self._reading

        async def read() -> None:
            if before is not None:
                await before
            stated = await self._orchestrator.adopt_parameters()
            self._recorder.bags.note(parameter_notes(stated))
            if wound:
                self.wound = dict(stated.get(topics.RIG, {}))

        self._reading = asyncio.create_task(read())


def parameter_notes(parameters: Mapping[str, Mapping[str, object]]) -> dict[str, str]:
    """Return the parameters of every node as a bag keeps them, for its replay."""
    return {f"{PARAMETERS}{name}": json.dumps(dict(own)) for name, own in parameters.items()}
