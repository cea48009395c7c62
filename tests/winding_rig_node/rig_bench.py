"""A rig's node that is active, a node that listens to it, and its services."""

from typing import Any

from rclpy.lifecycle import TransitionCallbackReturn
from std_srvs.srv import Trigger

from winding_rig_node.node import RigNode
from winding_ros import topics
from winding_ros.messages.stamps import serialised_stamp_ns


def rig_node(ros: Any, **parameters: object) -> RigNode:
    node: RigNode = ros.add(RigNode, parameters=parameters)
    return node


def refusal(ros: Any, **parameters: object) -> str:
    """Return why a rig is not configured."""
    node = rig_node(ros, **parameters)
    assert node.trigger_configure() is TransitionCallbackReturn.FAILURE
    return str(node._failure)


class RigBench:
    """An active rig that runs as fast as it can, and a probe.

    Attributes:
        stamps: Everything that the rig publishes once it is heard, by topic, in milliseconds.
    """

    def __init__(self, ros: Any, **parameters: object) -> None:
        self.ros = ros
        self.node = rig_node(ros, **({"speed": 0.0, "duration": 0.3} | parameters))
        self.probe = ros.plain()
        self.stamps: dict[str, list[int]] = {}
        for bring in (self.node.trigger_configure, self.node.trigger_activate):
            assert bring() is TransitionCallbackReturn.SUCCESS

    def hear(self) -> None:
        """Subscribe to everything that the rig publishes."""
        published = [topic for topic in topics.TOPICS if topic.publisher == topics.RIG]
        for topic in published:
            topic.subscribe(self.probe, self._note(topic.name), raw=True)
        self.ros.spin_until(lambda: all(self.node.matched(item.name) for item in published))

    def _note(self, name: str) -> Any:
        store = self.stamps.setdefault(name, [])
        return lambda data: store.append(round(serialised_stamp_ns(data) / 1e6))

    def command(self, name: str) -> Any:
        return self.ros.call(self.probe, Trigger, f"rig/{name}", Trigger.Request())

    def start(self) -> None:
        assert self.command("start").success

    def last(self) -> int:
        return self.stamps["rig/joint_states"][-1] if self.stamps["rig/joint_states"] else -1

    def wound(self, angle: float) -> None:
        """Wait until a motion-driven lay has come to an angle [rad]."""
        self.ros.spin_until(lambda: self.node._lay.wound_angle > angle)

    def wait_for(self, message: str) -> None:
        self.ros.spin_until(lambda: self.node.status().message == message)
