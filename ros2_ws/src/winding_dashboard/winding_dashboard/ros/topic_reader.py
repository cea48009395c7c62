"""Looks at the newest message of every topic ten times a second, and at no other."""

from collections.abc import Callable
from typing import Any

import numpy as np
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from winding_core.machine.axes import MachineAxes
from winding_dashboard.ros.parameters import DashboardParameters
from winding_dashboard.state.camera_view import CameraView
from winding_dashboard.state.health import node_of
from winding_dashboard.state.view_state import ViewState
from winding_ros import topics
from winding_ros.graph import PAGE
from winding_ros.messages.camera import CameraReading
from winding_ros.messages.rig import JointStateReader
from winding_ros.messages.serialised import MessageError
from winding_ros.topic import Topic

# The newest one is all that a look needs; a page must never hold up a publisher.
_NEWEST = QoSProfile(
    history=HistoryPolicy.KEEP_LAST, depth=1, reliability=ReliabilityPolicy.BEST_EFFORT
)
_QUEUE = 100


class TopicReader:
    """Takes messages on request; nothing wakes up for the thousand that come in between.

    Args:
        node: A node that no executor spins.
        parameters: Where the camera stands.
        state: What the page shows.
    """

    def __init__(self, node: Node, parameters: DashboardParameters, state: ViewState) -> None:
        self._parameters = parameters
        self._state = state
        self._namespace = node.get_namespace()
        self.refused = 0
        notes: dict[Topic, Callable[[float, Any], None]] = {
            topics.JOINT_STATES: state.note_axes,
            topics.JOINT_COMMANDS: self._source("setpoints"),
            topics.CAMERA_INFO: self._note_camera,
            topics.PREVIEW: self._source("picture"),
            topics.TRACKED_MARKERS: self._source("tracked"),
            topics.TRACKED_LAY: self._source("lay"),
            topics.FEM_MARKERS: self._source("predicted"),
            topics.FEM_CABLE: self._source("cable"),
            topics.FEM_CABLE_LINE: self._note_width,
            topics.CORRECTED_MARKERS: self._source("corrected"),
            topics.FEM_PREDICTION: self._source("ahead"),
            topics.CORRECTION_CASE: lambda _t, votes: state.note_votes(votes),
            topics.FEM_MATERIAL: self._source("material"),
            topics.LAY_CONTROL_STATE: state.control.note,
            topics.DIAGNOSTICS: lambda _t, statuses: state.note_statuses(self._now, statuses),
        }
        self._watched = [
            (_subscribe(node, topic), topic, notes.get(topic) or self._measured(topic))
            for topic in PAGE.extra_subscriptions
        ]
        self._axes: MachineAxes = parameters
        self._decode = {topics.JOINT_STATES: JointStateReader(self._axes)}
        self._now = 0.0

    def read_axes(self, axes: MachineAxes) -> None:
        """Read the machine's joints in another way from now on, unless it is the same."""
        if vars(axes) == {name: getattr(self._axes, name) for name in vars(axes)}:
            return
        self._axes = axes
        self._decode = {topics.JOINT_STATES: JointStateReader(axes)}

    def look(self, now: float) -> None:
        """Give the state what came since the last look; now is wall time [s].

        A message that cannot be used is counted and leaves the state as it was.
        """
        self._now = now
        for subscription, topic, note in self._watched:
            for _ in range(_QUEUE if topic.rate is None else 1):
                message = _take(subscription, topic)
                if message is None:
                    break
                if topic is topics.DIAGNOSTICS:
                    self._keep_the_graphs(message)
                try:
                    note(*self._decode.get(topic, topic.decode)(message))
                except MessageError:
                    self.refused += 1
        self._state.tick(now)

    def _source(self, name: str) -> Callable[[float, Any], None]:
        """Return what makes a message's content an attribute of the state, with its time."""
        return lambda t, content: self._state.note_source(name, t, content)

    def _measured(self, topic: Topic) -> Callable[[float, Any], None]:
        """Return what takes a sensor's value; a topic of another kind is shown as text."""
        quantity = topic.quantity
        if quantity is None:
            return lambda _t, content: self._state.note_other(topic.name, content)
        return lambda t, value: self._state.note_measured(quantity, t, value)

    def _note_width(self, _t: float, width: float) -> None:
        self._state.cable_radius = 0.5 * width

    def _note_camera(self, _t: float, reading: CameraReading) -> None:
        self._state.camera = CameraView(
            **vars(reading),
            position=np.array(self._parameters.camera_position),
            tilt=np.array(self._parameters.camera_tilt),
        )

    def _keep_the_graphs(self, diagnostics: Any) -> None:
        """Leave out the statuses of other graphs of the domain, and of pages."""
        own = ("", self._namespace)
        diagnostics.status = [
            item
            for item in diagnostics.status
            if item.hardware_id in own and node_of(item.name) != topics.DASHBOARD
        ]


def _subscribe(node: Node, topic: Topic) -> Subscription:
    return node.create_subscription(
        topic.type, topic.name, lambda message: None, topic.qos if topic.rate is None else _NEWEST
    )


def _take(subscription: Subscription, topic: Topic) -> Any | None:
    with subscription.handle:
        taken = subscription.handle.take_message(topic.type, False)
    return None if taken is None else taken[0]
