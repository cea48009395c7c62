"""Looks at the newest message of every topic ten times a second, and at no other."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from winding_core.markers import CABLE_DTYPE, CORRECTED_DTYPE, MARKER_DTYPE
from winding_dashboard.ros.parameters import DashboardParameters
from winding_dashboard.views.material_view import MaterialView
from winding_dashboard.views.projection import CameraView
from winding_dashboard.views.view_state import ViewState
from winding_ros import topics
from winding_ros.camera_messages import decode_camera_info, decode_preview
from winding_ros.cloud_messages import decode_cloud
from winding_ros.diagnostic_messages import decode_case_votes, decode_diagnostics
from winding_ros.material_messages import decode_material
from winding_ros.rig_messages import MessageError, decode_joint_state, decode_tension
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
        state: What is told.
    """

    def __init__(self, node: Node, parameters: DashboardParameters, state: ViewState) -> None:
        self._parameters = parameters
        self._state = state
        self._namespace = node.get_namespace()
        self.refused = 0
        watched: tuple[tuple[Topic, Callable[[Any], None]], ...] = (
            (topics.JOINT_STATES, self._on_joint_state),
            (topics.JOINT_COMMANDS, self._on_joint_command),
            (topics.TENSION, self._on_tension),
            (topics.CAMERA_INFO, self._on_camera_info),
            (topics.PREVIEW, self._on_preview),
            (topics.TRACKED_MARKERS, self._on_tracked),
            (topics.FEM_MARKERS, self._on_predicted),
            (topics.FEM_CABLE, self._on_cable),
            (topics.FEM_CABLE_LINE, self._on_cable_line),
            (topics.CORRECTED_MARKERS, self._on_corrected),
            (topics.FEM_PREDICTION, self._on_ahead),
            (topics.CORRECTION_CASE, self._on_votes),
            (topics.FEM_MATERIAL, self._on_material),
            (topics.DIAGNOSTICS, self._on_diagnostics),
        )
        self._watched = [(_subscribe(node, topic), topic, note) for topic, note in watched]
        self._now = 0.0

    def look(self, now: float) -> None:
        """Tell the state what came since the last look; now is wall time [s].

        A message that cannot be used is counted and leaves the state as it was.
        """
        self._now = now
        for subscription, topic, note in self._watched:
            for _ in range(_QUEUE if topic.rate is None else 1):
                message = _take(subscription, topic)
                if message is None:
                    break
                try:
                    note(message)
                except MessageError:
                    self.refused += 1
        self._state.tick(now)

    def _on_joint_state(self, message: Any) -> None:
        self._state.note_axes(*decode_joint_state(message))

    def _on_joint_command(self, message: Any) -> None:
        self._state.setpoints = decode_joint_state(message)[1]

    def _on_tension(self, message: Any) -> None:
        self._state.tension = decode_tension(message)[1]

    def _on_camera_info(self, message: Any) -> None:
        reading = decode_camera_info(message)[1]
        self._state.camera = CameraView(
            matrix=reading.matrix,
            distortion=reading.distortion,
            window=reading.window,
            width=reading.width,
            height=reading.height,
            position=np.array(self._parameters.camera_position),
            tilt=np.array(self._parameters.camera_tilt),
        )

    def _on_preview(self, message: Any) -> None:
        self._state.note_picture(*decode_preview(message))

    def _on_tracked(self, message: Any) -> None:
        self._state.note_tracked(*decode_cloud(message, MARKER_DTYPE))

    def _on_predicted(self, message: Any) -> None:
        self._state.predicted = decode_cloud(message, MARKER_DTYPE)[1]

    def _on_cable(self, message: Any) -> None:
        self._state.note_cable(*decode_cloud(message, CABLE_DTYPE))

    def _on_cable_line(self, message: Any) -> None:
        if message.scale.x > 0.0:
            self._state.cable_radius = 0.5 * message.scale.x

    def _on_corrected(self, message: Any) -> None:
        self._state.corrected = decode_cloud(message, CORRECTED_DTYPE)[1]

    def _on_ahead(self, message: Any) -> None:
        self._state.ahead = decode_cloud(message, MARKER_DTYPE)[1]

    def _on_votes(self, message: Any) -> None:
        self._state.note_votes(decode_case_votes(message)[1])

    def _on_material(self, message: Any) -> None:
        report = decode_material(message)[1]
        self._state.material = (
            None
            if report is None
            else MaterialView(
                law=report.law,
                young=report.young,
                half_width_90=report.half_width_90,
                markers=report.markers,
                taken_up=report.taken_up,
                refusal=report.refusal,
            )
        )

    def _on_diagnostics(self, message: Any) -> None:
        own = [item for item in message.status if item.hardware_id in ("", self._namespace)]
        message.status = own
        self._state.health.note(self._now, decode_diagnostics(message)[1])


def _subscribe(node: Node, topic: Topic) -> Subscription:
    return node.create_subscription(
        topic.type, topic.name, lambda message: None, topic.qos if topic.rate is None else _NEWEST
    )


def _take(subscription: Subscription, topic: Topic) -> Any | None:
    with subscription.handle:
        taken = subscription.handle.take_message(topic.type, False)
    return None if taken is None else taken[0]
