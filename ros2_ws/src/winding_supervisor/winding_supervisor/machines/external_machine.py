"""An external machine as its driver's topics and services show it, and where its axes stand."""

from __future__ import annotations

import asyncio
import dataclasses
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from rclpy.node import Node
from std_srvs.srv import Trigger

from winding_core.machine.axes import AxisReader, JointSample, MachineAxes, wrong_axis
from winding_core.machine.drive import DriveProfile
from winding_core.machine.incoming_readings import LEAD_IN, has_moved, stands
from winding_core.machine.readings import AxisReading
from winding_core.units import MILLIMETRE
from winding_recorder.live.run_buffer import BufferedMessage, RunBuffer
from winding_ros import services, topics
from winding_ros.client.async_client import AsyncClient
from winding_ros.graph import GraphError
from winding_ros.messages.rig import decode_joint_sample
from winding_ros.messages.serialised import MessageError, deserialised
from winding_ros.services import Service
from winding_ros.topic import Topic
from winding_supervisor.processes.discovery import RivalWatch

_POLL = 0.02
# The first half second of a motion may be over before it is noticed [s].
_NOTICED = 0.5
_SILENCE = 2.0
_START_TIMEOUT = 5.0
# A brake is released and a drive switched on before the axes move [s].
_MOTION_PATIENCE = 20.0
# A service that stops the machine has so long to answer before it is given up [s].
_STOP_TIMEOUT = 0.8
# Then the next one is asked as well: 1.2 s for two, and the failure is reported within two seconds.
_STOP_HASTE = 0.4
# So long after the first motion its direction and speed are judged [s].
_JUDGED = 3.0
PATIENCE = 30.0
# Standing readings are looked at for so long [s].
_LOOK = 0.5
# Positions of a machine that stands tremble by less than this within a look [rad, m].
_TREMBLING = (0.01, 2.0e-4)


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


class ExternalMachine:
    """Reads a machine's encoders from the buffer of the run, and calls its driver's services.

    Args:
        config: What is known of it.
        client: Calls its services.
        buffer: Has the messages of its driver.
        clock: Monotonic wall time [s].

    Attributes:
        axes: With the offsets of this run, once the machine was seen standing.
        began: Stamp of its first motion [s]; None before.
        end: Stamp at which the run was over [s]; None before.
    """

    name = topics.JOINT_STATES.name
    simulated = False

    def __init__(
        self,
        config: ExternalMachineConfig,
        client: AsyncClient,
        buffer: RunBuffer,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.axes = config.axes
        self.began: float | None = None
        self.end: float | None = None
        self.sensors: tuple[Topic, ...] = (topics.JOINT_STATES, topics.TENSION)
        if config.camera:
            self.sensors += (topics.CAMERA_INFO,)
        self._config = config
        self._client = client
        self._buffer = buffer
        self._clock = clock
        self._reader = AxisReader(self.axes)
        self._reading: tuple[float, AxisReading] | None = None
        self._still_since: float | None = None
        self._wrong = ""
        self._unstoppable = False

    @property
    def t(self) -> float:
        """Stamp of the newest encoder sample [s]."""
        return max(self._buffer.last_stamp(topics.JOINT_STATES), 0.0)

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
    def reading(self) -> AxisReading | None:
        """Both axes, as the newest encoder sample has them."""
        return None if self._reading is None else self._reading[1]

    def parameters(self) -> Mapping[str, object]:
        """Return the axes as the nodes are to read them."""
        return {**dataclasses.asdict(self.axes), "await_motion": True}

    def look(self) -> None:
        """Take note of the newest encoder sample: motion, its direction, the end of the run."""
        message = self._buffer.last(topics.JOINT_STATES)
        sample = None if message is None else joint_sample(message, self.axes)
        if sample is None or (self._reading is not None and sample.t <= self._reading[0]):
            return
        reading = self._reader.read(sample)
        self._reading = (sample.t, reading)
        if self.began is None and has_moved(reading):
            self.began = sample.t
        if self.began is None:
            return
        # What the first motion did not show yet belongs to the ramp.
        elapsed = sample.t - self.began + _NOTICED
        if elapsed < _JUDGED and not self._wrong:
            self._wrong = wrong_axis(reading, elapsed, self._config.drive, self._config.lead)
        self._note_end(sample.t, reading)

    def complaint(self) -> str:
        """Return why the run cannot go on with this machine, to follow its name, or nothing."""
        self.look()
        if self._wrong:
            return f"show that {self._wrong}"
        message = self._buffer.last(topics.JOINT_STATES)
        if message is not None:
            silent = self._clock() - message.received_ns * 1e-9
            if silent > _SILENCE:
                return f"are silent for {silent:.1f} s"
        return ""

    async def stand(self) -> None:
        """Wait until the machine is heard and stands; its place is the origin of the run.

        Raises:
            GraphError: No driver is heard, its joints have other names, or the machine moves.
        """
        known = self._config.axes
        self.axes = await standing_axes(self._client.node, self._buffer, known, self._clock)
        self.began = self.end = self._still_since = None
        self._wrong, self._unstoppable = "", False
        self._buffer.axes = self.axes
        self._buffer.origin = math.inf
        self._reader = AxisReader(self.axes)
        self._reading = None

    async def ready(self) -> None:
        """Let the nodes hear the standing machine; refuse one that has left its place meanwhile.

        A replay hears as much of the standstill as the nodes did only if they heard enough of it.

        Raises:
            GraphError: It has moved, or a sensor is silent.
        """
        heard, patience = self.t, self._clock() + _START_TIMEOUT
        while self.t < heard + 2.0 * LEAD_IN and self._clock() < patience:
            await asyncio.sleep(_POLL)
        for topic in self.sensors:
            if self._buffer.last(topic) is None:
                hint = "; without a camera give --no-camera" if topic is topics.CAMERA_INFO else ""
                raise GraphError(f"nothing has come on {topic.name}{hint}")
        self.look()
        reading = self.reading
        if reading is not None and has_moved(reading):
            raise GraphError(
                f"the machine moved by {reading.cylinder_angle:.3g} rad and "
                f"{reading.carriage_position / MILLIMETRE:.3g} mm while the nodes were starting: "
                "let it stand and begin again"
            )

    async def start(self) -> None:
        """Call rig/start, unless the machine begins by itself.

        Raises:
            GraphError: It was refused, or has no server.
        """
        await self._command(services.START)

    async def begun(self) -> None:
        """Wait for the first motion, and let the buffer begin with it.

        Raises:
            GraphError: A machine that was started does not move.
        """
        end = self._clock() + _MOTION_PATIENCE
        while self.began is None:
            self.look()
            if not self._config.starts_itself and self._clock() > end:
                raise GraphError(
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
            GraphError: It was refused, or has no server.
        """
        await self._command(services.RESET)

    async def leave(self) -> str:
        """Bring a machine to rest that this run has started; it stays to its driver otherwise.

        Returns:
            How that failed, or nothing.
        """
        if self._config.starts_itself or self.began is None or self._unstoppable or self.standing:
            return ""
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
        self._unstoppable = True
        failures = "; ".join(task.result() for task in asked)
        return f"the stop could not be delivered: {failures}"

    async def _command(self, service: Service) -> None:
        """Call a service of a machine that does not begin by itself.

        Raises:
            GraphError: It was refused, or has no server.
        """
        if self._config.starts_itself:
            return
        failure = await self._ask(service.name, _START_TIMEOUT)
        if failure:
            raise GraphError(failure)

    async def _ask(self, service: str, timeout: float) -> str:
        """Call a service; return how that failed, or nothing."""
        name = str(self._client.node.resolve_service_name(service))
        # A client that was made a moment ago may not have found its server yet.
        end = self._clock() + 0.5 * timeout
        while not self._client.ready(Trigger, name):
            if self._clock() > end:
                return f"{service} has no server"
            await asyncio.sleep(_POLL)
        try:
            answer = await self._client.call(Trigger, name, Trigger.Request(), timeout, retry=False)
        except TimeoutError:
            return f"no answer from {service} in {timeout:g} s"
        return "" if answer.success else f"{service} was refused: {answer.message}"

    def _note_end(self, t: float, reading: AxisReading) -> None:
        self._still_since = (self._still_since or t) if stands(reading) else None
        if self.end is not None:
            return
        rested = 0.0 if self._still_since is None else t - self._still_since
        if reading.cylinder_angle >= self._config.end_angle or rested > self._config.standing_limit:
            self.end = t


def _done_well(asked: list[asyncio.Task[str]]) -> bool:
    """Return whether a service has done what it was asked."""
    return any(task.done() and not task.result() for task in asked)


async def standing_axes(
    node: Node, buffer: RunBuffer, axes: MachineAxes, clock: Callable[[], float]
) -> MachineAxes:
    """Wait until a machine is heard and stands; return axes with their offsets there.

    Args:
        node: Knows the graph.
        buffer: Has the messages of the driver.
        axes: Joints, directions and units.
        clock: Monotonic wall time [s].

    Raises:
        GraphError: No driver is heard, its joints have other names, or the machine moves.
    """
    end = clock() + PATIENCE
    while True:
        samples = _recent(buffer, axes, clock())
        if samples is not None:
            turned, moved = _spread(samples, axes)
            if turned <= _TREMBLING[0] and moved <= _TREMBLING[1]:
                return axes.standing_at((item.cylinder, item.carriage) for item in samples)
        if clock() > end:
            raise GraphError(_why_not(node, buffer, axes, samples, clock()))
        await asyncio.sleep(_POLL)


def joint_sample(message: BufferedMessage, axes: MachineAxes) -> JointSample | None:
    """Return the joints of a buffered joint state; None for one that cannot be used."""
    try:
        return decode_joint_sample(deserialised(message.data, topics.JOINT_STATES.type), axes)
    except MessageError:
        return None


def _recent(buffer: RunBuffer, axes: MachineAxes, now: float) -> list[JointSample] | None:
    """Return the samples of the last look; None before they cover it."""
    found: list[JointSample] = []
    for message in reversed(buffer.messages[topics.JOINT_STATES.name]):
        sample = joint_sample(message, axes)
        if sample is None or now - message.received_ns * 1e-9 > 2.0 * _LOOK:
            return None
        found.append(sample)
        if found[0].t - sample.t >= _LOOK:
            return found
    return None


def _why_not(
    node: Node, buffer: RunBuffer, axes: MachineAxes, samples: list[JointSample] | None, now: float
) -> str:
    """Return why no standing machine was seen, as a sentence."""
    name = topics.JOINT_STATES.name
    message = buffer.last(topics.JOINT_STATES)
    if message is None:
        return (
            f"no driver is heard on {node.resolve_topic_name(name)} for {PATIENCE:g} s; start it, "
            "or see `winding conform`"
        )
    try:
        decode_joint_sample(deserialised(message.data, topics.JOINT_STATES.type), axes)
    except MessageError as error:
        return f"the driver's {error}; name its joints by cylinder_joint and carriage_joint"
    contested = RivalWatch(node, ()).look(now)
    if contested:
        return " ".join(contested)
    if samples is None:
        return f"{name} comes too seldom to tell whether the machine stands"
    turned, moved = _spread(samples, axes)
    return (
        f"the machine does not stand: within {_LOOK:g} s the cylinder turned {turned:.3g} rad "
        f"and the carriage moved {moved / MILLIMETRE:.3g} mm; a run begins at a standstill"
    )


def _spread(samples: list[JointSample], axes: MachineAxes) -> tuple[float, float]:
    """Return the range of the angle [rad] and of the carriage position [m]."""
    places = [axes.positions(item.cylinder, item.carriage) for item in samples]
    angles, ways = zip(*places, strict=True)
    return max(angles) - min(angles), max(ways) - min(ways)
