"""A commander of the carriage, as a process of its own with no clock but the machine's stamps.

`python commander.py '{"course": "sine by position", "rate": 100.0}' --ros-args -r __ns:=/commanded`
"""

import json
import sys
from collections.abc import Callable
from typing import Any

import rclpy
from commanded_machine import sine, sine_speed
from rclpy.node import Node
from sensor_msgs.msg import PointCloud2

from winding_core.machine.commands import CARRIAGE, AxisTarget, JointTargets
from winding_ros import topics
from winding_ros.messages.commands import encode_targets
from winding_ros.messages.stamps import decode_stamp

# What is commanded at a time of the machine [s].
COURSES: dict[str, Callable[[float], AxisTarget]] = {
    "sine by position": lambda t: AxisTarget(position=sine(t)),
    "sine by speed": lambda t: AxisTarget(speed=sine_speed(t)),
    "steady speed": lambda t: AxisTarget(speed=0.02),
}


REPEATED = 0.1  # An answer that was lost is repeated: the machine may be waiting for it [s]


class Commander(Node):
    """Commands a course at each tick of its rate, as the machine's encoders show it.

    Each command is followed by an answer on the topic of a node of the graph, for which a machine
    may wait before its time goes on.
    """

    def __init__(self, course: str, rate: float) -> None:
        super().__init__("commander")
        # Stamp 0 stands for now.
        self.course, self.period, self.due = COURSES[course], 1.0 / rate, 1.0 / rate
        self.targets = topics.JOINT_TARGETS.advertise(self)
        self.answers = topics.FEM_MARKERS.advertise(self)
        self.answer = PointCloud2()
        topics.JOINT_STATES.subscribe(self, self.follow)
        self.create_timer(REPEATED, lambda: self.answers.publish(self.answer))

    def follow(self, message: Any) -> None:
        t = decode_stamp(message.header.stamp)
        # Sums of periods are rounded.
        if t >= self.due - 1.0e-6:
            command = JointTargets(t=t, axes={CARRIAGE: self.course(t)})
            self.targets.publish(encode_targets(command))
            self.answer.header = message.header
            self.answers.publish(self.answer)
            self.due = t + self.period


if __name__ == "__main__":
    rclpy.init(args=sys.argv)
    rclpy.spin(Commander(**json.loads(sys.argv[1])))
