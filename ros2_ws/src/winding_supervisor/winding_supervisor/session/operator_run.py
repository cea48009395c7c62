"""Runs that an operator starts, stops and ends; nothing here moves the machine."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Callable, Coroutine, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rclpy.serialization import deserialize_message

from winding_core.run_options import OperatorLimits
from winding_core.run_outcome import Cause, EndedBy, Ending, Motion, RunOutcome
from winding_core.status import Status
from winding_recorder.bags.description import PARAMETERS
from winding_recorder.live.recorder import BufferedMessage, Recorder, RunBuffer
from winding_ros import topics
from winding_ros.client.async_client import AsyncClient
from winding_ros.messages.rig import decode_joint_state
from winding_ros.messages.serialised import MessageError
from winding_supervisor.processes.orchestrator import Orchestrator
from winding_supervisor.session.machine_run import Completion
from winding_supervisor.session.outcome_status import tell_outcome
from winding_supervisor.watch.event_log import EventLog

_POLL = 0.05
_VIEW_PERIOD = 0.25
_FINISHED, _WINDING, _EMERGENCY = "finished", "winding", "emergency stop"
SESSION_ENDED = "the operator ended the session"
_IDLE, _STOPPING = "idle", "stopping"
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
    """Return stamp [ns] and angle of the cylinder [rad]; None for an invalid sample."""
    try:
        _, reading = decode_joint_state(deserialize_message(message.data, topics.JOINT_STATES.type))
    except MessageError:
        return None
    return message.stamp_ns, reading.cylinder_angle


@dataclass(frozen=True, kw_only=True, eq=False)
class OperatedRun:
    """One of the runs of an operator.

    Attributes:
        limits: The limits that the operator had set at its end; None where the page reported none.
    """

    buffer: RunBuffer  # Of this run alone; nothing is added to it
    wound: Mapping[str, object]  # Parameters of the machine; empty while they are being read
    wall_s: float  # How long it took [s]
    bags: tuple[Path, ...]  # That were recorded meanwhile
    ending: Ending
    limits: OperatorLimits | None = None


class OperatorRun:
    """Follows what an operator does with the machine, run by run, until the operator ends it.

    The operator may prepare another condition, start, stop, reset and stop in an emergency, as
    often as they like. Every run that was begun is delivered once: when it is finished or stopped
    in an emergency, when the next one begins, or at the end. The buffer keeps the last run alone.

    Args:
        client: The orchestrator's node.
        orchestrator: Learns what the nodes are set to, for those that it restarts.
        recorder: Its buffer and its notes.
        ended: Is set when the operator ends the session.
        log: Has what supervision did, and the cause of the present run's end.
        deliver: Takes a run that is over, in a thread of its own.
        limits: Returns the limits that the operator has set; None where none are set.
        started_with: Parameters that the machine was started with.
    """

    def __init__(
        self,
        client: AsyncClient,
        orchestrator: Orchestrator,
        recorder: Recorder,
        ended: asyncio.Event,
        log: EventLog,
        deliver: Callable[[OperatedRun], RunOutcome | None],
        limits: Callable[[], OperatorLimits | None],
        started_with: Mapping[str, object],
    ) -> None:
        self._client = client
        self._limits = limits
        self._orchestrator = orchestrator
        self._recorder = recorder
        self._ended = ended
        self._log = log
        self._deliver = deliver
        self._phase: str | None = None
        self._start = RunStart()
        self._ending: Completion | None = None
        self._begun = time.monotonic()
        self._over: float | None = None
        self._open = False
        self._undelivered: list[OperatedRun] = []
        self._bags = 0
        self._wound: dict[str, object] = {}
        # What the machine was last found to be set to.
        self._set = started_with
        self._reading: asyncio.Task[None] | None = None
        self._delivering: asyncio.Task[None] | None = None

    @property
    def wall_s(self) -> float:
        """How long the present run has taken [s]."""
        return (self._over or time.monotonic()) - self._begun

    async def follow(
        self, work: Iterable[Coroutine[Any, Any, None]], view: Callable[[RunBuffer, float], None]
    ) -> None:
        """Return when the operator has ended the session and every run is delivered.

        Args:
            work: What must go on meanwhile; when one of it fails, so does this.
            view: Called a few times per second with the buffer and the wall time [s].
        """
        buffer = self._recorder.buffer
        beside = [asyncio.create_task(item) for item in work]
        shown = time.monotonic() - _VIEW_PERIOD
        try:
            while not self._ended.is_set():
                for task in filter(None, (*beside, self._delivering, self._reading)):
                    if task.done():
                        task.result()
                self._notice()
                if self._open and self._finished():
                    self._close(buffer.before())
                if time.monotonic() - shown >= _VIEW_PERIOD:
                    view(buffer, self.wall_s)
                    shown = time.monotonic()
                await asyncio.sleep(_POLL)
            if self._open:
                self._end(SESSION_ENDED)
                self._close(buffer.before())
            if self._delivering is not None:
                await self._delivering
        finally:
            for task in (*beside, *([self._reading] if self._reading else [])):
                task.cancel()

    def remaining(self) -> list[OperatedRun]:
        """Return the runs that were not delivered before the session ended early."""
        if self._open:
            self._note_over(self._recorder.buffer.before())
        left, self._undelivered = self._undelivered, []
        limits = self._limits()
        wound = dict(self._wound)
        return [replace(run, wound=run.wound or wound, limits=limits) for run in left]

    def _finished(self) -> bool:
        return self._ending is not None and self._ending.reached(
            self._recorder.buffer, time.monotonic()
        )

    def _notice(self) -> None:
        """Look at what the operator has made of the machine since the last look."""
        if self._start.look(self._recorder.buffer):
            cut, origin = RunStart.cut(self._recorder.buffer)
            if self._open:
                self._end("reset by the operator")
                self._close(self._recorder.buffer.before(cut))
            self._recorder.buffer.begin_anew(cut, origin)
            self._begun, self._over, self._ending = time.monotonic(), None, None
        status = self._client.status(topics.RIG) or Status(name=topics.RIG)
        phase = status.values.get("phase")
        if phase == _EMERGENCY and "stood_at" in status.values and self._ending is None:
            self._ending = Completion(float(status.values["stood_at"]))
        if phase == self._phase:
            return
        known, self._phase = self._phase is not None, phase
        if phase == _WINDING:
            if not self._open:
                if self._log.held is None:
                    self._log.begin_run()
                self._begun, self._over = time.monotonic(), None
                tell_outcome(self._client, self._recorder.buffer.time, None)
            self._open, self._ending = True, None
            self._log.resume()
        elif phase == _FINISHED:
            self._ending = Completion(float(status.values["time"]))
        elif self._open and phase is not None and phase != _IDLE:
            self._log.hold(self._stop_cause(phase, status))
        # Another condition may have been prepared, or parameters set by hand.
        if phase is not None and (phase in (_WINDING, _IDLE) or not known):
            self._read(wound=phase == _WINDING)

    def _stop_cause(self, phase: str, status: Status) -> Cause:
        """Return why the machine stops in mid-run; what supervision did is noted already."""
        reason = status.values.get("reason", "")
        by = EndedBy.MACHINE if reason else EndedBy.OPERATOR
        stopped = "stopped by the operator" if phase == _STOPPING else phase
        text = f"{phase}: {reason}" if reason else stopped
        return Cause(by=by, source=topics.RIG, text=text, t=self._recorder.buffer.time)

    def _end(self, text: str) -> None:
        """Note that the operator ends a run; what stopped its machine before is the cause."""
        t = self._recorder.buffer.time
        self._log.end(Cause(by=EndedBy.OPERATOR, source="dashboard", text=text, t=t))

    def _close(self, buffer: RunBuffer) -> None:
        """Let a run be delivered after those before it."""
        run = self._note_over(buffer)
        reading, before = self._reading, self._delivering

        async def deliver() -> None:
            for task in (before, reading):
                if task is not None:
                    await task
            self._undelivered.remove(run)
            over = replace(run, wound=run.wound or dict(self._wound), limits=self._limits())
            outcome = await asyncio.to_thread(self._deliver, over)
            if not self._open:
                tell_outcome(self._client, self._recorder.buffer.time, outcome)

        self._delivering = asyncio.create_task(deliver())

    def _note_over(self, buffer: RunBuffer) -> OperatedRun:
        self._open, self._over = False, time.monotonic()
        if self._log.held is not None:
            self._log.end(self._log.held)
        bags = self._recorder.bags.present(self._bags)
        # The next run's may have begun already, without a file yet.
        self._bags = self._recorder.bags.folders.index(bags[-1]) + 1 if bags else self._bags
        run = OperatedRun(
            buffer=buffer,
            wound=dict(self._wound) if self._reading is None or self._reading.done() else {},
            wall_s=self._over - self._begun,
            bags=bags,
            # Its drives end with its process, and its time with its run.
            ending=self._log.ending(Motion.STANDING),
        )
        self._log.begin_run()
        self._undelivered.append(run)
        return run

    def _read(self, *, wound: bool) -> None:
        before = self._reading
        if wound:
            # A run may fail before the nodes have answered.
            self._wound = dict(self._set)

        async def read() -> None:
            if before is not None:
                await before
            stated = await self._orchestrator.adopt_parameters()
            self._recorder.bags.note(parameter_notes(stated))
            self._set = stated.get(topics.RIG, self._set)
            if wound:
                self._wound = dict(self._set)

        self._reading = asyncio.create_task(read())


def parameter_notes(parameters: Mapping[str, Mapping[str, object]]) -> dict[str, str]:
    """Return the parameters of every node as a bag keeps them, for its replay."""
    return {f"{PARAMETERS}{name}": json.dumps(dict(own)) for name, own in parameters.items()}
