"""The solver's node between a machine and a tracker, and what it publishes."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from rclpy.lifecycle import TransitionCallbackReturn
from rods import CASE, DRIVE

from cable_fem_node.node import CableFemNode
from cable_fem_node.ros.message_handler import FemHandler
from winding_core.machine.readings import AxisReading
from winding_core.markers import MARKER_DTYPE, Markers, wound_markers
from winding_ros import topics
from winding_ros.messages.clouds import decode_cloud, encode_cloud
from winding_ros.messages.rig import encode_joint_state, encode_tension
from winding_ros.topic import Topic

SUCCESS, FAILURE = TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.FAILURE
PUBLISHED = (topics.FEM_MARKERS, topics.FEM_CABLE, topics.FEM_PREDICTION, topics.FEM_MATERIAL)


def solver_node(ros: Any, **parameters: object) -> CableFemNode:
    """Return a node of case 4 that is not configured yet."""
    node: CableFemNode = ros.add(CableFemNode, parameters={"case": 4, **parameters})
    return node


def heard_by(probe: Any) -> dict[Topic, list[Any]]:
    """Return the messages that a probe receives, by topic; more come as it is spun."""
    heard: dict[Topic, list[Any]] = {t: [] for t in (*PUBLISHED, topics.TRACKED_MARKERS)}
    for topic, messages in heard.items():
        topic.subscribe(probe, messages.append)
    return heard


def fed(
    handler: FemHandler,
    rows: Iterable[tuple[float, AxisReading, float | None]],
    topic: Topic = topics.FEM_MARKERS,
    kind: np.dtype[np.void] = MARKER_DTYPE,
) -> list[tuple[float, Any]]:
    """Give a handler times [s], readings and tensions [N]; return its clouds of one topic."""
    answers = []
    for t, reading, tension in rows:
        if tension is not None:
            answers += handler.take(topics.TENSION, encode_tension(t, tension))
        answers += handler.take(topics.JOINT_STATES, encode_joint_state(t, reading))
    return [decode_cloud(answer.data, kind) for answer in answers if answer.topic is topic]


class SolverBench:
    """An active node with a machine and a tracker.

    Attributes:
        node: The solver's.
        heard: What has been published, by topic.
    """

    def __init__(self, ros: Any, **parameters: object) -> None:
        self.node = solver_node(ros, **parameters)
        probe = ros.plain()
        self.heard = heard_by(probe)
        self._ros, self._sample = ros, 0
        self._joints = topics.JOINT_STATES.advertise(probe)
        self._tension = topics.TENSION.advertise(probe)
        self._tracker = topics.TRACKED_MARKERS.advertise(probe)
        assert self.node.trigger_configure() is SUCCESS
        assert self.node.trigger_activate() is SUCCESS
        ros.spin_until(
            lambda: (
                self._joints.get_subscription_count() == 1
                and self._tension.get_subscription_count() == 1
                and self._tracker.get_subscription_count() == 2
                and all(self.node.matched(topic.name) == 1 for topic in PUBLISHED)
            )
        )

    def begin_anew(self) -> None:
        assert self.node.trigger_deactivate() is SUCCESS
        assert self.node.trigger_activate() is SUCCESS

    def pull(self, tension: float) -> None:
        """Publish a tension [N] of the run's start."""
        self._tension.publish(encode_tension(0.0, tension))

    def wind(self, until: float, period: float = 0.01) -> None:
        """Let the machine wind until a time [s], and wait until the node has followed."""
        last = round(until / period)
        for sample in range(self._sample, last + 1):
            t = sample * period
            self._joints.publish(encode_joint_state(t, DRIVE.reading_at(t)))
        self._sample = last + 1
        self._ros.spin_until(lambda: self.node._handler.history.latest >= until - 2.0 * period)

    def track(self, t: float, theta: float, flags: int = 0) -> None:
        """Let the tracker see P1 in thirty frames from a time [s] on."""
        rng = np.random.default_rng(1)
        for frame in range(30):
            markers = wound_markers(
                ids=[0, 1],
                theta=[0.0, theta + 2e-3 * rng.standard_normal()],
                z=[0.0, 0.0042],
                radius=CASE.centreline_radius,
                cylinder_angle=7.0,
                sigma_theta=[0.0, 2e-3],
                sigma_z=[0.0, 1e-4],
                flags=[0, flags],
            )
            self._tracker.publish(encode_cloud(t + 0.005 * frame, markers))

    def wait_for(self, topic: Topic, count: int) -> list[Any]:
        self._ros.spin_until(lambda: len(self.heard[topic]) >= count)
        return self.heard[topic]

    def markers(self, topic: Topic) -> list[tuple[float, Markers]]:
        """Return stamp [s] and markers of what has been published."""
        return [decode_cloud(message, MARKER_DTYPE) for message in self.heard[topic]]
