"""Runs that an operator begins, stops and resets at the simulated machine, which reports them."""

import asyncio
from collections.abc import Mapping

from rclpy.serialization import deserialize_message

from winding_core.run_outcome import Cause, EndedBy
from winding_core.status import Status
from winding_recorder.live.recorder import BufferedMessage, RunBuffer
from winding_ros import topics
from winding_ros.messages.rig import decode_joint_state
from winding_ros.messages.serialised import MessageError
from winding_supervisor.session.conduct import Conduct
from winding_supervisor.session.participants import Participants
from winding_supervisor.session.run_config import parameter_notes

_POLL = 0.02
_FINISHED, _WINDING, _EMERGENCY = "finished", "winding", "emergency stop"
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


class RigConduct(Conduct):
    """Runs of the simulated machine; nothing here moves it.

    The operator may prepare another condition, start, stop, reset and stop in an emergency, as
    often as they like. A run is over when it is finished or stopped in an emergency, when a stopped
    machine is reset, or when the next one begins.

    Args:
        who: Takes part: the orchestrator learns what the nodes are set to, for those that it
            restarts, the log takes why the machine stands in mid-run.
        started_with: Parameters that the machine was started with.
    """

    operated = throughout = True

    def __init__(self, who: Participants, started_with: Mapping[str, object]) -> None:
        super().__init__(who)
        self._log, self._recorder = who.log, who.recorder
        self._start = RunStart()
        self._phase: str | None = None
        self._under_way = False
        self._end: float | None = None
        self._stop: Cause | None = None
        # When the machine was last found to wind [s]; the time of one that is built anew is zero.
        self._wound_at = 0.0
        # Whether the encoders have gone back since the last run that was noticed.
        self._renewed = False
        # What the machine was last found to be set to.
        self._set = started_with

    @property
    def end(self) -> float | None:
        """Stamp at which it was finished, or stood after an emergency stop [s]; None before."""
        return self._end

    @property
    def early(self) -> Cause | None:
        """Why the machine was stopped for good; None for a run that was finished."""
        return self._stop

    async def begun(self) -> None:
        """Wait until it winds."""
        while not self._under_way:
            await asyncio.sleep(_POLL)

    async def made_ready(self) -> None:
        """Return at once: the operator resets the machine, or prepares another condition."""
        self._renewed = self.anew is not None
        if self.anew is not None:
            self._recorder.buffer.begin_anew(*self.anew)
            # It may wind already.
            self._phase, self._wound_at = None, 0.0
        self._under_way, self._end, self._stop, self.anew = False, None, None, None

    def catch_up(self) -> bool:
        """Return whether the encoders show a run that the machine has not yet reported."""
        newest = self._recorder.buffer.last(topics.JOINT_STATES)
        place = None if newest is None else _place(newest)
        if not self._renewed or place is None or place[1] < _FELL_BACK:
            return False
        self.wound = dict(self._set)
        return True

    def look(self) -> bool:
        """Look at what the operator has made of the machine since the last look."""
        if self._start.look(self._recorder.buffer):
            self.anew = RunStart.cut(self._recorder.buffer)
            return True
        status = self._who.client.status(topics.RIG) or Status(name=topics.RIG)
        phase = status.values.get("phase")
        if phase == _WINDING:
            t = float(status.values["time"])
            if t < self._wound_at or not self._heard_until(t):
                # The encoders show first whether it is another run that is wound.
                return False
            self._wound_at = t
        if phase == _EMERGENCY and "stood_at" in status.values and self._end is None:
            self._end = float(status.values["stood_at"])
        if phase == _IDLE and self._stop is not None and float(status.values["run_time"]) == 0.0:
            # What was stopped has been reset and cannot be resumed.
            self._end = self._end or self._recorder.buffer.last_stamp(topics.JOINT_STATES)
        if phase != self._phase:
            known, self._phase = self._phase is not None, phase
            self._enter(phase, status)
            # Another condition may have been prepared, or parameters set by hand.
            if phase is not None and (phase in (_WINDING, _IDLE) or not known):
                self._read(wound=phase == _WINDING)
        return False

    def _heard_until(self, t: float) -> bool:
        """Return whether the encoder has come as far as a time of the machine [s]."""
        return self._recorder.buffer.last_stamp(topics.JOINT_STATES) > t - 1e-3

    def _enter(self, phase: str | None, status: Status) -> None:
        if phase == _WINDING:
            if self._under_way:
                self._log.resume()
            elif self._log.held is None:
                # Otherwise supervision has stopped the machine since this was reported.
                self._log.begin_run()
            self._under_way, self._end, self._stop = True, None, None
        elif phase == _FINISHED:
            self._end = float(status.values["time"])
        elif self._under_way and phase is not None and phase != _IDLE:
            self._stop = self._stop_cause(phase, status)
            self._log.hold(self._stop)

    def _stop_cause(self, phase: str, status: Status) -> Cause:
        """Return why the machine stops in mid-run; what supervision did is noted already."""
        reason = status.values.get("reason", "")
        by = EndedBy.MACHINE if reason else EndedBy.OPERATOR
        stopped = "stopped by the operator" if phase == _STOPPING else phase
        text = f"{phase}: {reason}" if reason else stopped
        return Cause(by=by, source=topics.RIG, text=text, t=self._recorder.buffer.time)

    def _read(self, *, wound: bool) -> None:
        before = self.reading
        if wound:
            # A run may fail before the nodes have answered.
            self.wound = dict(self._set)

        async def read() -> None:
            if before is not None:
                await before
            configured = await self._who.orchestrator.adopt_parameters()
            self._recorder.bags.note(parameter_notes(configured))
            self._set = configured.get(topics.RIG, self._set)
            if wound:
                self.wound = dict(self._set)

        self.reading = asyncio.create_task(read())
