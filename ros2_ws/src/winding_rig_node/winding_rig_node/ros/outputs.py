"""What the rig publishes: encoded, with the faults that are put in on purpose, and its status."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from winding_core.machine.readings import AxisReading, Quantity
from winding_core.status import Level, Status
from winding_rig_node.machine.faults import Faults, Values
from winding_rig_node.machine.machine import Machine
from winding_rig_node.machine.machine_config import SAMPLE_RATE, Phase
from winding_rig_node.machine.pace import Pace
from winding_ros import graph, topics
from winding_ros.messages.camera import (
    CameraReading,
    camera_info_template,
    encode_image,
    encode_preview,
)
from winding_ros.messages.rig import encode_clock, encode_joint_state, encode_quantity
from winding_ros.runtime.managed_node import ManagedNode
from winding_ros.topic import Topic

_MEASURED = tuple(
    (topic, topic.quantity) for topic in graph.RIG.publishes if topic.quantity is not None
)


class Outputs:
    """Publications of the rig, topic by topic."""

    def __init__(self, node: ManagedNode[Any]) -> None:
        # What is wrong with the topics on purpose; a healthy topic costs nothing.
        self.faults = Faults()
        self._publish = node.endpoints.publish
        self.exposed = node.endpoints.trace.exposed  # Notes that the pixels of a frame are there
        self._calibration: CameraReading | None = None

    def sample(self, machine: Machine) -> None:
        """Publish what of clock, axes and sensors is due at the machine's present sample."""
        t, sample = machine.time, machine.state.drive_sample
        if due(sample, topics.CLOCK):
            self.clock(t)
        self.joints(topics.JOINT_STATES, t, machine.reading(), *machine.arm_joints)
        if due(sample, topics.JOINT_COMMANDS):
            self.joints(topics.JOINT_COMMANDS, t, machine.setpoints())
        self.measured(t, sample, machine.sensors)

    def clock(self, t: float) -> None:
        """Publish simulated time [s]."""
        for stamp, values in self._through(topics.CLOCK, t, lambda: np.array([t])):
            claimed = stamp if values is None else float(values[0])
            # A time that is no time at all cannot be written into a stamp.
            if np.isfinite(claimed) and 0.0 <= claimed < 2.0**31:
                self._publish(topics.CLOCK, encode_clock(claimed))

    def joints(
        self,
        topic: Topic,
        t: float,
        reading: AxisReading,
        names: tuple[str, ...] = (),
        positions: tuple[float, ...] = (),
    ) -> None:
        """Publish both axes, as measured or as commanded, and joints of an arm [rad or m]."""
        for stamp, values in self._through(topic, t, lambda: np.array(reading.numbers)):
            sent = reading if values is None else _with_numbers(reading, values)
            self._publish(topic, encode_joint_state(stamp, sent, names, positions))

    def measured(
        self, t: float, sample: int, sensors: Mapping[str, Callable[[], float | None]]
    ) -> None:
        """Publish the sensors whose turn it is at a sample of the run."""
        for topic, quantity in _MEASURED:
            value = sensors[quantity.name]() if due(sample, topic) else None
            if value is not None:
                self._measured(topic, quantity, t, value)

    def camera_info(self, t: float, calibration: CameraReading) -> None:
        """Publish the camera's calibration."""
        for stamp, values in self._through(topics.CAMERA_INFO, t, calibration.matrix.copy):
            sent = calibration
            if values is not None:
                matrix = np.asarray(values, dtype=float).reshape(3, 3)
                sent = replace(calibration, matrix=matrix)
            if sent is not self._calibration:
                self._calibration, self._info = sent, camera_info_template(sent)
            self._publish(topics.CAMERA_INFO, bytes(self._info.stamped(stamp)))

    def image(self, t: float, frame: NDArray[np.uint8]) -> None:
        """Publish a frame, shape (height, width, 3), of time t [s]."""
        for stamp, values in self._through(topics.IMAGE, t, lambda: frame):
            sent = frame if values is None else np.asarray(values, dtype=np.uint8)
            self._publish(topics.IMAGE, encode_image(stamp, sent))

    def preview(self, t: float, jpeg: bytes) -> None:
        """Publish a compressed frame."""
        for stamp, values in self._through(
            topics.PREVIEW, t, lambda: np.frombuffer(jpeg, dtype=np.uint8)
        ):
            self._publish(
                topics.PREVIEW, encode_preview(stamp, jpeg if values is None else values.tobytes())
            )

    def _measured(self, topic: Topic, quantity: Quantity, t: float, value: float) -> None:
        for stamp, values in self._through(topic, t, lambda: np.array([value])):
            sent = value if values is None else float(values[0])
            self._publish(topic, encode_quantity(topic.type, quantity, stamp, sent))

    def _through(
        self, topic: Topic, t: float, values: Callable[[], Values]
    ) -> Iterator[tuple[float, Values | None]]:
        """Yield (stamp, values) of what goes out; values is None when nothing is wrong."""
        channel = self.faults.of(topic.name)
        if channel is None:
            yield t, None
            return
        for delivery in channel.deliver(t, values()):
            yield delivery.t, delivery.values


def due(sample: int, topic: Topic) -> bool:
    """Return whether a topic of a fixed rate has its turn at a sample of the run."""
    assert topic.rate is not None
    return sample % round(SAMPLE_RATE / topic.rate) == 0


def _with_numbers(reading: AxisReading, values: Values) -> AxisReading:
    angle, angular_speed, position, feed_speed = map(float, values)
    return replace(
        reading,
        cylinder_angle=angle,
        angular_speed=angular_speed,
        carriage_position=position,
        feed_speed=feed_speed,
    )


def rig_status(machine: Machine, pace: Pace, faults: str, known_lay: str) -> Status:
    """Return the machine's phase and time, and how far its readers are behind.

    Args:
        machine: The machine.
        pace: What the readers have answered.
        faults: The faults that are put in on purpose, as text.
        known_lay: Name of the lay that the camera shows whatever is commanded; empty for none.
    """
    state = machine.state
    commander = machine.commander
    unseen = ""
    if known_lay and (commander.axes or commander.brake is not None):
        unseen = f"the camera shows lay {known_lay!r}, which does not follow commands"
    doubts = state.reason or faults or commander.refusal or unseen or machine.remark
    level = Level.WARN if doubts else Level.OK
    if state.phase in (Phase.EMERGENCY, Phase.PROTECTIVE):
        level = Level.ERROR
    values = {
        "time": f"{machine.time:.3f}",
        "run_time": f"{state.drive_sample / SAMPLE_RATE:.3f}",
        "phase": state.phase.value,
        "reason": state.reason,
        "slowest": pace.slowest if pace.answered else "",
    }
    # Of simulated time: what waits on the way to a reader, and in it, is not longer.
    values |= {
        f"lead over {name} [s]": f"{max(machine.time - t, 0.0):.3f}"
        for name, t in pace.answered.items()
    }
    refused = machine.plausibility.refused
    values |= {f"refused {name}": str(count) for name, count in refused.items()}
    if commander.axes:
        values["commanded"] = ", ".join(commander.axes)
    if commander.brake is not None:
        values["brake [N]"] = f"{commander.brake.wanted:.3f}"
    if commander.refused:
        values |= {"refused commands": str(commander.refused), "refusal": commander.refusal}
    if faults:
        values["faults"] = faults
    for name, moment in (("stop_began", state.stop_began), ("stood_at", state.stood_at)):
        values |= {name: f"{moment:.3f}"} if moment is not None else {}
    return Status(
        name=topics.RIG,
        level=level,
        message=": ".join(
            filter(
                None,
                (state.phase.value, state.reason or machine.remark or commander.refusal or unseen),
            )
        ),
        values=values,
    )
