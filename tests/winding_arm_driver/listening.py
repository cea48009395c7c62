"""What a driver of an arm publishes, and targets for it."""

from typing import Any

from winding_core.machine.axes import MachineAxes
from winding_core.machine.commands import CARRIAGE, AxisTarget, JointTargets
from winding_core.machine.readings import AxisReading
from winding_ros import topics
from winding_ros.messages.commands import encode_targets
from winding_ros.messages.diagnostics import decode_diagnostics
from winding_ros.messages.rig import JointStateReader


class Listener:
    """Takes joint states and diagnostics of the driver, and sends targets of the carriage.

    Args:
        node: Whose topics they are.
    """

    def __init__(self, node: Any) -> None:
        self.readings, self.messages = list[AxisReading](), list[str]()
        read, states = JointStateReader(MachineAxes()), topics.JOINT_STATES
        node.create_subscription(
            states.type, states.name, lambda message: self._take(read(message)[1]), states.qos
        )
        node.create_subscription(
            topics.DIAGNOSTICS.type, topics.DIAGNOSTICS.name, self._note, topics.DIAGNOSTICS.qos
        )
        self._targets = node.create_publisher(
            topics.JOINT_TARGETS.type, topics.JOINT_TARGETS.name, 1
        )

    def _take(self, reading: AxisReading) -> None:
        self.readings.append(reading)

    def _note(self, message: Any) -> None:
        self.messages.extend(status.message for status in decode_diagnostics(message)[1])

    def aim(self, position: float) -> None:
        target = JointTargets(t=0.0, axes={CARRIAGE: AxisTarget(position=position)})
        self._targets.publish(encode_targets(target))
