"""Listens to a driver, and with leave moves its machine, to find out whether it conforms."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import Any

from rclpy.qos import ReliabilityPolicy
from std_srvs.srv import Trigger

from winding_cli.cell.driver_judgement import (
    LOWEST_ENCODER_RATE_HZ,
    LOWEST_FRAME_RATE_HZ,
    LOWEST_TENSION_RATE_HZ,
    Finding,
    Heard,
    judge_camera,
    judge_clock,
    judge_encoder,
    judge_stream,
    judge_tension,
    runs,
    stands,
)
from winding_core.machine.axes import MachineAxes, wrong_axis
from winding_core.machine.commands import CARRIAGE, AxisTarget, JointTargets
from winding_core.machine.drive import DriveProfile
from winding_core.machine.incoming_readings import MOTION, missing_joints
from winding_core.machine.readings import AxisReading
from winding_core.units import MILLIMETRE
from winding_ros import services, topics
from winding_ros.client.async_client import AsyncClient
from winding_ros.messages.camera import decode_camera_info, decode_image
from winding_ros.messages.commands import encode_targets
from winding_ros.messages.rig import JointStateReader, decode_tension
from winding_ros.messages.serialised import MessageError
from winding_ros.messages.stamps import decode_stamp
from winding_ros.topic import Topic

_PERIOD = 0.02
DEAD_MAN = 0.5  # How long an unanswered motion may go on, by the interface [s]
# A stamp that is older than the dead-man time by far [s].
_LATE = 2.0
_LISTEN = 0.6
_FOLLOWED = 1.5
# Of the feed speed, so that the carriage's own programme is distinguished from a command.
_SHARE = 0.5
_TOLERANCE = 0.25


class CommandProbe:
    """Commands the carriage of a machine that is free to move."""

    def __init__(self, client: AsyncClient, axes: MachineAxes, probe: Probe) -> None:
        self._axes = axes
        self._probe = probe
        self._publisher = topics.JOINT_TARGETS.advertise(client.node)

    async def findings(self, running: tuple[float, float], stop_within: float) -> list[Finding]:
        """Return what the machine does with commands; nothing where it takes none.

        Args:
            running: Angular speed [rad/s] and feed speed [m/s] when it winds.
            stop_within: Longest time to standstill [s].
        """
        try:
            await self._probe.until(self._heard, 1.0, "listener")
        except TimeoutError:
            return []
        feed = running[1]
        return [
            await self._before_the_start(feed),
            await self._probe.begins("rig/start", running),
            await self._late(feed),
            await self._followed(_SHARE * feed),
            await self._lost(running, DEAD_MAN + stop_within),
        ]

    def _heard(self) -> bool:
        return int(self._publisher.get_subscription_count()) > 0

    async def _before_the_start(self, feed: float) -> Finding:
        moved = await self._command(_LISTEN, lambda since: (feed * (1.0 + since), feed))
        return Finding(
            "rig/joint_targets before rig/start: change nothing",
            f"the carriage moved {moved / MILLIMETRE:.3f} mm",
            kept=abs(moved) <= MOTION[1],
        )

    async def _late(self, feed: float) -> Finding:
        moved = await self._command(_LISTEN, lambda _: (0.0, 0.0), late=_LATE)
        return Finding(
            f"rig/joint_targets stamped {_LATE:g} s ago: change nothing",
            f"the carriage moved {moved / MILLIMETRE:.3f} mm in {_LISTEN:g} s",
            kept=abs(moved - feed * _LISTEN) <= 0.5 * feed * _LISTEN,
        )

    async def _followed(self, speed: float) -> Finding:
        moved = await self._command(_FOLLOWED, lambda since: (speed * since, speed))
        wanted = speed * _FOLLOWED
        return Finding(
            "rig/joint_targets while it winds: the carriage goes where it is commanded",
            f"{moved / MILLIMETRE:.3f} mm of {wanted / MILLIMETRE:.3f} mm",
            kept=abs(moved - wanted) <= _TOLERANCE * wanted,
        )

    async def _lost(self, running: tuple[float, float], within: float) -> Finding:
        took, late = await self._probe.takes(
            lambda value: stands(value, running), 2.0 * within, "standstill"
        )
        _, omega, _, feed = self._probe.encoder.values[-1]
        going = f"{late}; it went on at {omega:.3g} rad/s and {feed / MILLIMETRE:.3g} mm/s"
        # A stop may be latched without a request.
        await self._probe.ask("rig/stop" if late else "rig/reset")
        return Finding(
            f"rig/joint_targets end in motion: both axes stand within {within:g} s",
            going if late else f"after {took:.2f} s",
            kept=not late and took <= within,
        )

    async def _command(
        self, seconds: float, wanted: Callable[[float], tuple[float, float]], late: float = 0.0
    ) -> float:
        """Send ways [m] and speeds [m/s] by the time since the first; return the way gone [m].

        Args:
            seconds: For how long [s].
            wanted: Returns the way from where the carriage is at first, and the speed.
            late: How much older than the machine's newest sample they are stamped [s].
        """
        first, scale = self._place, self._axes.carriage_scale
        begin = self._probe.encoder.stamps[-1]
        while (now := self._probe.encoder.stamps[-1]) - begin < seconds:
            way, speed = wanted(now - begin)
            position = (first + way) / scale + self._axes.carriage_offset
            target = AxisTarget(position=position, speed=speed / scale)
            message = encode_targets(JointTargets(t=now - late, axes={CARRIAGE: target}))
            message.name = [self._axes.carriage_joint]
            self._publisher.publish(message)
            await asyncio.sleep(_PERIOD)
        return self._place - first

    @property
    def _place(self) -> float:
        return self._probe.encoder.values[-1][2]


RIG_SERVICES = (
    services.START,
    services.STOP,
    services.QUICK_STOP,
    services.EMERGENCY_STOP,
    services.RESET,
)
_ANSWER_WITHIN = 5.0
_POLL = 0.01
_RAMP_S = 3.0


class Probe:
    """One look at a driver through the graph's own decoders.

    Args:
        client: A spinning node in the driver's namespace.
        frames: On which the driver's camera brings them; None without a camera.
        axes: Joints of the machine.
    """

    def __init__(self, client: AsyncClient, *, frames: Topic | None, axes: MachineAxes) -> None:
        self._client = client
        self._frames = frames
        self._axes = axes
        self.commanded = False  # Whether the machine took commands when it was moved
        self._joints: list[tuple[str, ...]] = []
        read = JointStateReader(axes)

        def encoder(message: Any) -> tuple[float, tuple[float, ...]]:
            self._joints.append(tuple(message.name))
            t, reading = read(message)
            return t, reading.numbers

        def tension(message: Any) -> tuple[float, tuple[float, ...]]:
            t, force = decode_tension(message)
            return t, (force,)

        wanted: dict[Topic, Callable[[Any], tuple[float, tuple[float, ...]]]] = {
            topics.JOINT_STATES: encoder,
            topics.TENSION: tension,
        }
        if frames is topics.PREVIEW:
            wanted[frames] = lambda message: (decode_stamp(message.header.stamp), ())
        elif frames is not None:
            wanted[frames] = lambda message: (decode_image(message)[0], ())
        if frames is not None:
            wanted[topics.CAMERA_INFO] = lambda message: (decode_camera_info(message)[0], ())
        self.heard = {topic.name: Heard() for topic in wanted}  # By topic
        self._topics = tuple(wanted)
        for topic, decode in wanted.items():
            topic.subscribe(client.node, self._note(topic.name, decode))

    async def listen(self, seconds: float) -> None:
        """Hear every topic for so long [s], counted from the first encoder sample.

        Raises:
            TimeoutError: Nothing comes on rig/joint_states.
            ValueError: What comes there cannot be read.
        """
        heard, name = self.encoder, topics.JOINT_STATES.name
        await self.until(lambda: bool(heard.stamps or heard.refused), 10.0, f"message on {name}")
        begun = time.monotonic()
        await asyncio.sleep(seconds)
        if heard.stamps:
            return
        took = time.monotonic() - begun
        raise ValueError(
            missing_joints(name, self._joints, took, self._axes)
            or f"{len(self._joints) / took:.0f} messages/s arrive on {name} and none can be "
            f"read: {heard.refused[0]}"
        )

    def findings(self) -> list[Finding]:
        """Return the findings on the driver from the streams received so far."""
        encoder = self.heard[topics.JOINT_STATES.name]
        tension = self.heard[topics.TENSION.name]
        found = [self._offered(topic) for topic in self._topics]
        found += judge_stream(topics.JOINT_STATES.name, encoder, LOWEST_ENCODER_RATE_HZ)
        found += judge_encoder(encoder)
        found += judge_stream(topics.TENSION.name, tension, LOWEST_TENSION_RATE_HZ)
        found += judge_tension(tension)
        if self._frames is not None:
            name = self._frames.name
            images, infos = self.heard[name], self.heard[topics.CAMERA_INFO.name]
            found += judge_stream(name, images, LOWEST_FRAME_RATE_HZ)
            found += judge_stream(topics.CAMERA_INFO.name, infos, LOWEST_FRAME_RATE_HZ)
            found += judge_camera(images, infos, encoder, name)
        found.append(judge_clock(tuple(self.heard.values())))
        return found

    async def services(self) -> list[Finding]:
        """Return whether every service of the machine is there with its type."""
        offered: dict[str, list[str]] = dict(self._client.node.get_service_names_and_types())
        found = []
        for service in RIG_SERVICES:
            name = self._client.node.resolve_service_name(service.name)
            kinds = offered.get(name, ["not there"])
            found.append(
                Finding(
                    f"{service.name}: a {service.type_name} service",
                    ", ".join(kinds),
                    kept=service.type_name in kinds,
                )
            )
        return found

    async def moves(self, running: tuple[float, float], stop_within: float) -> list[Finding]:
        """Start, stop and emergency-stop the machine; it must be free to move.

        Args:
            running: Angular speed [rad/s] and feed speed [m/s] when it winds; it counts as winding
                above half of both and as standing below a hundredth.
            stop_within: Longest time from the answered request to standstill [s].
        """
        commands = CommandProbe(self._client, self._axes, self)
        found = await commands.findings(running, stop_within)
        self.commanded = bool(found)
        stood = self.encoder.values[-1]
        for stop in ("rig/stop", "rig/quick_stop", "rig/emergency_stop"):
            found.append(await self.begins("rig/start", running))
            if stop == "rig/stop":
                found.append(self._directions(stood, running))
            found.append(await self._ends(stop, running, stop_within))
        refused = await self.ask("rig/start")
        found.append(
            Finding(
                "rig/start after an emergency stop: refused until rig/reset",
                refused.message or "accepted",
                kept=not refused.success,
            )
        )
        reset = await self.ask("rig/reset")
        found.append(Finding("rig/reset: accepted", reset.message, kept=reset.success))
        return found

    def _directions(self, stood: tuple[float, ...], running: tuple[float, float]) -> Finding:
        """Return whether both axes have moved the right way since they stood."""
        now = self.encoder.values[-1]
        wrong = wrong_axis(
            AxisReading(
                cylinder_angle=now[0] - stood[0],
                angular_speed=now[1],
                carriage_position=now[2] - stood[2],
                feed_speed=now[3],
            ),
            _RAMP_S,
            DriveProfile(angular_speed=running[0], feed_speed=running[1], ramp_time=0.0),
        )
        return Finding(
            "rig/joint_states: positive in the direction of winding, in radians and metres",
            wrong or f"{now[0] - stood[0]:.3g} rad and {now[2] - stood[2]:.3g} m",
            kept=not wrong,
        )

    @property
    def encoder(self) -> Heard:
        """What was received of the machine's joints."""
        return self.heard[topics.JOINT_STATES.name]

    async def begins(self, service: str, running: tuple[float, float]) -> Finding:
        """Ask a service to wind; return whether both axes do."""
        answer = await self.ask(service)
        took, late = await self.takes(
            lambda value: runs(value, running), _RAMP_S, "winding at half speed"
        )
        return Finding(
            f"{service}: both axes wind within {_RAMP_S:g} s",
            late or f"after {took:.2f} s",
            kept=not late and answer.success,
        )

    async def _ends(self, service: str, running: tuple[float, float], within: float) -> Finding:
        answer = await self.ask(service)
        took, late = await self.takes(
            lambda value: stands(value, running), 4.0 * within, "standstill"
        )
        return Finding(
            f"{service}: standstill within {within:g} s",
            late or f"{took:.2f} s",
            kept=not late and answer.success and took <= within,
        )

    async def takes(
        self, reached: Callable[[tuple[float, ...]], bool], seconds: float, what: str
    ) -> tuple[float, str]:
        """Return how long [s] the axes take to reach a state, and why they did not, or nothing."""
        begun, late = time.monotonic(), ""
        try:
            await self.until(lambda: reached(self.encoder.values[-1]), seconds, what)
        except TimeoutError as error:
            late = str(error)
        return time.monotonic() - begun, late

    async def ask(self, service: str) -> Any:
        """Return what a service answers."""
        return await self._client.call(Trigger, service, Trigger.Request(), _ANSWER_WITHIN)

    async def until(self, reached: Callable[[], bool], seconds: float, what: str) -> None:
        """Wait until something is reached.

        Raises:
            TimeoutError: It is not within so long [s].
        """
        deadline = time.monotonic() + seconds
        while not reached():
            if time.monotonic() > deadline:
                raise TimeoutError(f"no {what} within {seconds:g} s")
            await asyncio.sleep(_POLL)

    def _offered(self, topic: Topic) -> Finding:
        publishers = self._client.node.get_publishers_info_by_topic(
            self._client.node.resolve_topic_name(topic.name)
        )
        reliable = [
            end.qos_profile.reliability is not ReliabilityPolicy.BEST_EFFORT for end in publishers
        ]
        return Finding(
            f"{topic.name}: one publisher, {topic.type_name}, reliable",
            ", ".join(
                f"{end.node_name} ({end.topic_type}, {end.qos_profile.reliability.name.lower()})"
                for end in publishers
            )
            or "no publisher",
            kept=len(publishers) == 1
            and all(reliable)
            and publishers[0].topic_type == topic.type_name,
        )

    def _note(
        self, name: str, decode: Callable[[Any], tuple[float, tuple[float, ...]]]
    ) -> Callable[[Any], None]:
        heard = self.heard[name]

        def note(message: Any) -> None:
            arrived = time.time()
            try:
                t, value = decode(message)
            except MessageError as error:
                heard.refused.append(str(error))
                return
            heard.arrived.append(arrived)
            heard.values.append(value)
            heard.stamps.append(t)

        return note
