"""An external machine as its driver's topics and services show it, and where its axes stand."""

import asyncio
import dataclasses
import math
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from std_srvs.srv import Trigger

from winding_core.machine.axes import AxisReader, JointSample, MachineAxes, wrong_axis
from winding_core.machine.drive import DriveProfile
from winding_core.machine.incoming_readings import LEAD_IN, has_moved, stands
from winding_core.machine.readings import AxisReading
from winding_core.machine.watch_clock import WatchClock
from winding_core.run_outcome import Cause, EndedBy, Motion
from winding_core.units import MILLIMETRE
from winding_recorder.live.run_buffer import BufferedMessage, RunBuffer
from winding_ros import services, topics
from winding_ros.client.async_client import AsyncClient
from winding_ros.graph import GraphError
from winding_ros.services import Service
from winding_supervisor.machines.machine import Machine
from winding_supervisor.machines.standing_axes import joint_sample, standing_axes

_POLL = 0.02
# The first half second of a motion may be over before it is noticed [s].
_NOTICED = 0.5
_SILENCE = 2.0
# A machine that stands for longer in mid-run is reported [s].
_NOTED_STANDING = 2.0
_TURN = 2.0 * math.pi
# The end is reached when it is missed by less, as an encoder stands after its ramp [rad].
_END_SLACK = 0.05
# A driver that shares its computer may answer late; nothing moves meanwhile [s].
_START_TIMEOUT = 20.0
_DISCOVERY = 2.5  # A client that was made a moment ago may not have found its server yet [s]
_MOTION_PATIENCE = 20.0  # A brake is released and a drive switched on before the axes move [s]
# A service that stops the machine has so long to answer before it is given up [s].
_STOP_TIMEOUT = 0.8
# Then the next one is asked as well: 1.2 s for two, and the failure is reported within two seconds.
_STOP_HASTE = 0.4
_JUDGED = 3.0  # So long after the first motion its direction and speed are judged [s]


class MachineError(GraphError):
    """The machine refuses, does not answer, or is not as a run needs it."""


@dataclass(frozen=True, kw_only=True)
class ExternalMachineConfig:
    """How a run deals with a machine that an external driver moves."""

    axes: MachineAxes  # Its joints; the offsets are measured before the start
    drive: DriveProfile  # How its axes are expected to move
    end_angle: float  # Cylinder angle at which the run is over [rad]
    camera: bool  # Whether there is one
    starts_itself: bool  # Whether the machine begins by itself instead of by rig/start
    standing_limit: float  # A machine that stands for longer has ended its run [s]
    lead: float = 0.0  # Way by which a controlled carriage goes ahead of the cable at first [m]


class ExternalMachine(Machine):
    """Reads a machine's encoders from the buffer of the run, and calls its driver's services."""

    name = topics.JOINT_STATES.name
    simulated = False

    def __init__(
        self,
        config: ExternalMachineConfig,
        client: AsyncClient,
        buffer: RunBuffer,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        camera = (topics.CAMERA_INFO,) if config.camera else ()
        super().__init__(client, buffer, topics.JOINT_STATES, topics.TENSION, *camera)
        self.axes = config.axes  # With the offsets of this run, once the machine was seen standing
        self.began: float | None = None  # Stamp of its first motion [s]; None before
        self._config = config
        self._clock = clock
        self._reader = AxisReader(self.axes)
        # Both axes, as the newest encoder sample has them, and its stamp [s].
        self.reading: AxisReading | None = None
        self._read_at = -math.inf
        self._seen_ns = 0
        self._still_since: float | None = None
        self._wrong = ""
        self._looks = WatchClock()
        self._heard = 0.0

    @property
    def when(self) -> str:
        """The present time of the run in words."""
        if self.began is None:
            return "before the machine moved"
        return f"{self.t - self.began:.3f} s after the machine's first motion"

    @property
    def built(self) -> bool:
        """Whether its driver has spoken."""
        return self._buffer.last(topics.JOINT_STATES) is not None

    @property
    def moving(self) -> bool:
        """Whether an axis moves."""
        return not self.standing

    @property
    def standing(self) -> bool:
        """Whether both axes stand, by their encoders."""
        self.look()
        return self.reading is None or stands(self.reading)

    @property
    def motion(self) -> Motion:
        """What is known of its axes now; a machine that has fallen silent is not known to stand."""
        self.look()
        if self.reading is not None and self._silent <= _SILENCE and stands(self.reading):
            return Motion.STANDING
        if self._config.starts_itself:
            return Motion.DRIVEN
        return Motion.TURNING if self._silent <= _SILENCE and self.reading else Motion.UNKNOWN

    @property
    def early(self) -> Cause | None:
        """Why its end is not the one that was asked for; None where it is, or is not reached."""
        if self.end is None or self.turned >= self._config.end_angle - _END_SLACK:
            return None
        return Cause(
            by=EndedBy.MACHINE,
            source=self.name,
            text=f"the machine stopped by itself after {self._turns} and stood for "
            f"{self._config.standing_limit:g} s",
            t=self.end - (self.began or self.end),
        )

    def remark(self) -> str:
        """Return what an operator should know of it although the run goes on, or nothing."""
        if self.began is None or self.end is not None or self._rested < _NOTED_STANDING:
            return ""
        return (
            f"the machine stands after {self._turns}; the run ends when it has stood for "
            f"{self._config.standing_limit:g} s"
        )

    @property
    def turned(self) -> float:
        """Angle of the cylinder in the newest sample [rad]."""
        return 0.0 if self.reading is None else self.reading.cylinder_angle

    @property
    def _turns(self) -> str:
        return f"{self.turned / _TURN:.2f} of {self._config.end_angle / _TURN:.2f} turns"

    @property
    def _rested(self) -> float:
        return 0.0 if self._still_since is None else self._read_at - self._still_since

    def parameters(self) -> Mapping[str, object]:
        """Return the axes as the nodes are to read them."""
        return {**dataclasses.asdict(self.axes), "await_motion": True}

    def look(self) -> None:
        """Take note of every encoder sample since the last look, in the order they came."""
        now = self._looks.look(self._clock())
        for message in self._unseen():
            self._heard = now
            sample = joint_sample(message, self.axes)
            if sample is not None and sample.t > self._read_at:
                self._take(sample)

    @property
    def _silent(self) -> float:
        return self._looks.time - self._heard

    def _unseen(self) -> Iterator[BufferedMessage]:
        """Yield the encoder samples that have arrived since the last look, the oldest first."""
        unseen = []
        for message in reversed(self._buffer.messages[topics.JOINT_STATES.name]):
            if message.received_ns <= self._seen_ns:
                break
            unseen.append(message)
        if unseen:
            self._seen_ns = unseen[0].received_ns
        return reversed(unseen)

    def _take(self, sample: JointSample) -> None:
        reading = self._reader.read(sample)
        self.reading, self._read_at = reading, sample.t
        if self.began is None and has_moved(reading):
            self.began = sample.t
        if self.began is None:
            return
        # What the first motion did not show yet belongs to the ramp.
        elapsed = sample.t - self.began + _NOTICED
        if elapsed < _JUDGED and not self._wrong:
            self._wrong = wrong_axis(reading, elapsed, self._config.drive, self._config.lead)
        self._still_since = (self._still_since or sample.t) if stands(reading) else None
        if self.end is None and (
            reading.cylinder_angle >= self._config.end_angle
            or self._rested > self._config.standing_limit
        ):
            self._end = sample.t

    def complaint(self) -> str:
        """Return why the run cannot go on with this machine, to follow its name, or nothing."""
        self.look()
        if self._wrong:
            return f"show that {self._wrong}"
        if self.reading is not None and self._silent > _SILENCE:
            return f"are silent for {self._silent:.1f} s"
        return ""

    async def stand(self) -> None:
        """Wait until the machine is heard and stands; its place is the origin of the run.

        Raises:
            MachineError: No driver is heard, its joints have other names, or the machine moves.
        """
        known = self._config.axes
        self.axes = await standing_axes(self._client.node, self._buffer, known, self._clock)
        self.began = self._end = self._still_since = None
        self._wrong = ""
        self._buffer.axes = self.axes
        self._buffer.origin = math.inf
        self._reader = AxisReader(self.axes)
        self.reading, self._read_at = None, -math.inf
        self._heard = self._looks.look(self._clock())
        newest = self._buffer.last(topics.JOINT_STATES)
        self._seen_ns = 0 if newest is None else newest.received_ns

    async def ready(self) -> None:
        """Let the nodes hear the standing machine; refuse one that has left its place meanwhile.

        A replay hears as much of the standstill as the nodes did only if they heard enough of it.

        Raises:
            MachineError: It has moved, or a sensor is silent.
        """
        heard, patience = self.t, self._clock() + _START_TIMEOUT
        while self.t < heard + 2.0 * LEAD_IN and self._clock() < patience:
            await asyncio.sleep(_POLL)
        for topic in self.sensors:
            if self._buffer.last(topic) is None:
                hint = "; without a camera give --no-camera" if topic is topics.CAMERA_INFO else ""
                raise MachineError(f"nothing has come on {topic.name}{hint}")
        self.look()
        reading = self.reading
        if reading is not None and has_moved(reading):
            raise MachineError(
                f"the machine moved by {reading.cylinder_angle:.3g} rad and "
                f"{reading.carriage_position / MILLIMETRE:.3g} mm while the nodes were starting: "
                "let it stand and begin again"
            )

    async def start(self) -> None:
        """Call rig/start, unless the machine begins by itself.

        Raises:
            MachineError: It was refused, or has no server.
        """
        await self._command(services.START)

    async def begun(self) -> None:
        """Wait for the first motion, and let the buffer begin with it.

        Raises:
            MachineError: A machine that was started does not move.
        """
        end = self._clock() + _MOTION_PATIENCE
        while self.began is None:
            self.look()
            if not self._config.starts_itself and self._clock() > end:
                raise MachineError(
                    f"{services.START.name} was accepted and neither axis has moved within "
                    f"{_MOTION_PATIENCE:g} s"
                )
            await asyncio.sleep(_POLL)
        first = round(1e9 * (self.began - LEAD_IN))
        for message in self._buffer.messages[topics.JOINT_STATES.name]:
            if message.stamp_ns >= first:
                self._buffer.begin_anew(message.received_ns, message.stamp_ns * 1e-9)
                return

    async def quick_stop(self) -> str:
        """Call rig/quick_stop, and rig/stop if that fails or is late; return how both failed."""
        return await self._stop(services.QUICK_STOP, services.STOP)

    async def reset(self) -> None:
        """Call rig/reset between two runs, unless the machine begins by itself.

        Raises:
            MachineError: It was refused, or has no server.
        """
        await self._command(services.RESET)

    async def leave(self) -> str | None:
        """Bring a machine to rest that this run has started; it stays to its driver otherwise.

        Returns:
            How a stop failed, empty for one that was delivered; None where none was needed.
        """
        if self._config.starts_itself or self.began is None or self.motion is Motion.STANDING:
            return None
        return await self._stop(services.STOP, services.QUICK_STOP)

    async def _stop(self, *ways: Service) -> str:
        """Call services until one has stopped the machine; return how all failed, or nothing.

        The next is called when the one before fails or is late, whose answer still counts.
        """
        asked: list[asyncio.Task[str]] = []
        try:
            for service in ways:
                asked.append(asyncio.create_task(self._ask(service.name, _STOP_TIMEOUT)))
                await asyncio.wait(asked[-1:], timeout=_STOP_HASTE)
                if _done_well(asked):
                    return ""
            for answer in asyncio.as_completed(asked):
                if not await answer:
                    return ""
        finally:
            for task in asked:
                task.cancel()
        failures = "; ".join(task.result() for task in asked)
        return f"the stop could not be delivered: {failures}"

    async def _command(self, service: Service) -> None:
        """Call a service of a machine that does not begin by itself.

        Raises:
            MachineError: It was refused, or has no server.
        """
        if self._config.starts_itself:
            return
        failure = await self._ask(service.name, _START_TIMEOUT)
        if failure:
            raise MachineError(failure)

    async def _ask(self, service: str, timeout: float) -> str:
        """Call a service; return how that failed, or nothing."""
        name = str(self._client.node.resolve_service_name(service))
        end = self._clock() + min(0.5 * timeout, _DISCOVERY)
        while not self._client.ready(Trigger, name):
            if self._clock() > end:
                return f"{service} has no server"
            await asyncio.sleep(_POLL)
        try:
            answer = await self._client.call(Trigger, name, Trigger.Request(), timeout, retry=False)
        except TimeoutError:
            return f"no answer from {service} in {timeout:g} s"
        return "" if answer.success else f"{service} was refused: {answer.message}"


def _done_well(asked: list[asyncio.Task[str]]) -> bool:
    """Return whether a service has done what it was asked."""
    return any(task.done() and not task.result() for task in asked)
