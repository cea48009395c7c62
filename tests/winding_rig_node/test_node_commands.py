"""Commands over DDS: each interface moves the machine, or reports why it does not."""

from typing import Any

import pytest
from rig_bench import RigBench, refusal
from sensor_msgs.msg import JointState

from winding_core.cases import paper_case
from winding_core.commands import JointTrajectory, Waypoint
from winding_core.status import Level
from winding_ros import topics
from winding_ros.command_messages import encode_trajectory
from winding_ros.rig_messages import encode_tension
from winding_ros.topic import Topic

pytestmark = pytest.mark.slow


class Commanded(RigBench):
    """A rig that winds in wall time, and a commander that repeats what it wants."""

    def __init__(self, ros: Any) -> None:
        super().__init__(ros, speed=1.0, duration=60.0)
        self.axes: Any = None
        self.force = 0.0
        topics.JOINT_STATES.subscribe(self.probe, lambda message: setattr(self, "axes", message))
        topics.TENSION.subscribe(self.probe, self._weigh)
        self.publishers = {
            topic: topic.advertise(self.probe) for topic in topics.published_by(topics.COMMANDER)
        }
        ros.spin_until(
            lambda: all(item.get_subscription_count() == 1 for item in self.publishers.values())
        )
        ros.spin_until(lambda: self.node.matched("rig/joint_states") == 1)
        self.start()
        ros.spin_until(lambda: self.axes is not None)

    def _weigh(self, message: Any) -> None:
        self.force = message.wrench.force.x

    def send(self, topic: Topic, message: Any) -> None:
        self.publishers[topic].publish(message)

    def until(self, reached: Any, topic: Topic, message: Any) -> None:
        """Repeat a command until what it asks for is there."""

        def look() -> bool:
            self.send(topic, message)
            return bool(reached())

        self.ros.spin_until(look)

    @property
    def carriage(self) -> float:
        return float(self.axes.position[1])

    @property
    def values(self) -> Any:
        return self.node.status().values


def test_joint_targets_move_an_axis(ros):
    bench = Commanded(ros)
    # As topic_based_ros2_control sends them: NaN for interfaces that are not commanded.
    wanted = JointState(
        name=["cylinder_joint", "carriage_joint"], position=[float("nan"), -0.01], velocity=[]
    )
    bench.until(lambda: abs(bench.carriage + 0.01) < 0.1e-3, topics.JOINT_TARGETS, wanted)
    assert bench.values["commanded"] == "carriage"
    assert bench.axes.velocity[0] > 0.5


def test_a_joint_trajectory_moves_both_axes_to_its_end(ros):
    bench = Commanded(ros)
    angle = bench.axes.position[0] + 0.5
    waypoints = {
        "carriage": (Waypoint(t=0.4, position=0.01), Waypoint(t=0.8, position=0.02)),
        "cylinder": (Waypoint(t=0.4, position=angle), Waypoint(t=0.8, position=angle)),
    }
    plan = encode_trajectory(JointTrajectory(t=0.0, axes=waypoints))
    bench.send(topics.JOINT_TRAJECTORY, plan)
    ros.spin_until(lambda: abs(bench.carriage - 0.02) < 0.1e-3)
    ros.spin_until(lambda: abs(bench.axes.position[0] - angle) < 1.0e-3)


def test_a_tension_command_sets_the_brake(ros):
    bench = Commanded(ros)
    pull = 1.5 * paper_case(4).weight
    bench.send(topics.TENSION_COMMAND, encode_tension(0.0, pull))
    ros.spin_until(lambda: abs(bench.force - pull) < 0.05)
    assert bench.values["brake [N]"] == f"{pull:.3f}"


def test_a_refused_command_is_told_in_diagnostics(ros):
    bench = Commanded(ros)
    wanted = JointState(name=["carriage_joint"], position=[3.0])
    bench.send(topics.JOINT_TARGETS, wanted)
    ros.spin_until(lambda: "refusal" in bench.values)
    status = bench.node.status()
    assert status.message == "winding: carriage position must lie in -0.1 to 1 m, got 3"
    assert status.level is Level.WARN
    bench.send(topics.JOINT_TARGETS, JointState(name=["guide"], position=[0.0]))
    ros.spin_until(lambda: "joints must be" in bench.values["refusal"])
    assert bench.values["refused commands"] == "2"


def test_two_commanders_at_once_are_refused(ros):
    bench = Commanded(ros)
    other = topics.JOINT_TARGETS.advertise(ros.plain("other"))
    ros.spin_until(lambda: other.get_subscription_count() == 1)
    wanted = JointState(name=["carriage_joint"], velocity=[0.01])
    bench.until(lambda: "refusal" in bench.values, topics.JOINT_TARGETS, wanted)
    assert bench.values["refusal"] == "one commander at a time, got 2: other, probe"


def test_a_commander_that_falls_silent_stops_the_machine(ros):
    bench = Commanded(ros)
    wanted = JointState(name=["carriage_joint"], velocity=[0.02])
    bench.until(lambda: bench.axes.velocity[1] > 0.015, topics.JOINT_TARGETS, wanted)
    ros.spin_until(lambda: bench.values["phase"] == "idle")
    assert bench.values["reason"].startswith("no command for the carriage for more than 0.5 s")


def test_limits_that_contradict_each_other_are_refused(ros):
    sentence = refusal(ros, carriage_travel=[0.5, 0.1])
    assert "travel must end above its start, got 0.5 to 0.1 m" in sentence
