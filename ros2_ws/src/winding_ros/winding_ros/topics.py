"""Every topic of the graph, declared once: name, type, quality of service, rate, recorded."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, JointState, PointCloud2
from std_msgs.msg import Header
from visualization_msgs.msg import Marker

# Reliable delivery keeps what a stalled reader has not taken yet: depth is rate x worst stall.
WORST_STALL_S = 2.0


@dataclass(frozen=True, kw_only=True)
class Topic:
    """One topic of the graph contract.

    Attributes:
        name: Relative to the graph's namespace, or absolute.
        type: Message class.
        rate: Nominal messages per simulated second; None for topics sent on change.
        publisher: Name of the node that publishes it; EVERY_NODE for shared topics.
        depth: History kept for a slow reader.
        latched: Whether late subscribers get the last message.
        recorded: Whether the recorder stores it.
        description: One line for the interface table.
    """

    name: str
    type: type
    rate: float | None
    publisher: str
    depth: int
    latched: bool = False
    recorded: bool = True
    description: str

    @property
    def type_name(self) -> str:
        """Full ROS name of the message type, as bags write it."""
        package, kind, *_ = self.type.__module__.split(".")
        return f"{package}/{kind}/{self.type.__name__}"

    @property
    def qos(self) -> QoSProfile:
        """Reliable, keep last `depth`, transient local when latched."""
        durability = DurabilityPolicy.TRANSIENT_LOCAL if self.latched else DurabilityPolicy.VOLATILE
        return QoSProfile(
            history=HistoryPolicy.KEEP_LAST,
            depth=self.depth,
            reliability=ReliabilityPolicy.RELIABLE,
            durability=durability,
        )

    def subscribe(
        self,
        node: Node,
        callback: Callable[[Any], None],
        *,
        raw: bool = False,
        events: SubscriptionEventCallbacks | None = None,
        found: Callable[[int], None] | None = None,
    ) -> Subscription:
        """Return a subscription on a node; raw callbacks get the serialised bytes.

        `found` is told how many messages waited at each wake-up.

        One wake-up serves every message that waits. An executor by itself takes one message of
        each topic per round: a reader in arrears would see a 1 kHz topic fall ever further
        behind a 200 Hz one.
        """

        def serve(message: Any) -> None:
            awake = time.time_ns()
            callback(message)
            count = 1
            for waiting, arrived in self.waiting(subscription, raw=raw):
                callback(waiting)
                # What arrives while others are served did not wait for the node to wake up.
                count += arrived <= awake
            if found is not None:
                found(count)

        subscription = self.listen(node, serve, raw=raw, events=events)
        return subscription

    def listen(
        self,
        node: Node,
        woken: Callable[[Any], None],
        *,
        raw: bool = False,
        events: SubscriptionEventCallbacks | None = None,
    ) -> Subscription:
        """Return a subscription whose callback gets one message and takes those that wait."""
        subscription: Subscription = node.create_subscription(
            self.type,
            self.name,
            woken,
            self.qos,
            qos_overriding_options=QoSOverridingOptions.with_default_policies(),
            raw=raw,
            event_callbacks=events,
        )
        return subscription

    def waiting(
        self, subscription: Subscription, *, raw: bool = False
    ) -> Iterator[tuple[Any, int]]:
        """Take the messages that have arrived on a subscription of this topic, `depth` at most.

        Yields:
            The message, and when it arrived by the clock of the system [ns].
        """
        for _ in range(self.depth):
            with subscription.handle:
                taken = subscription.handle.take_message(self.type, raw)
            if taken is None:
                return
            message, information = taken
            yield message, information["received_timestamp"]

    def advertise(self, node: Node) -> Publisher:
        """Return a plain publisher on a node that is not managed."""
        return node.create_publisher(
            self.type,
            self.name,
            self.qos,
            qos_overriding_options=QoSOverridingOptions.with_default_policies(),
        )


def _topic(
    name: str,
    type_: type,
    rate: float | None,
    publisher: str,
    description: str,
    *,
    latched: bool = False,
    recorded: bool = True,
) -> Topic:
    return Topic(
        name=name,
        type=type_,
        rate=rate,
        publisher=publisher,
        depth=max(10, int((rate or 0.0) * WORST_STALL_S)),
        latched=latched,
        recorded=recorded,
        description=description,
    )


RIG, TRACKER, FEM, CORRECTION, RECORDER, DASHBOARD = (
    "winding_rig",
    "marker_tracker",
    "cable_fem",
    "correction",
    "recorder",
    "dashboard",
)

CLOCK = _topic("/clock", Clock, 100.0, RIG, "simulated time")
JOINT_STATES = _topic(
    "rig/joint_states", JointState, 1000.0, RIG, "encoder samples of cylinder and carriage"
)
JOINT_COMMANDS = _topic(
    "rig/joint_commands", JointState, 50.0, RIG, "setpoints of cylinder and carriage"
)
TENSION = _topic("rig/tension", WrenchStamped, 100.0, RIG, "load cell at the guide, force.x [N]")
IMAGE = _topic("camera/image_raw", Image, 200.0, RIG, "windowed camera frames, bgr8")
CAMERA_INFO = _topic(
    "camera/camera_info", CameraInfo, 200.0, RIG, "full-resolution calibration, window and binning"
)
PREVIEW = _topic("camera/image_raw/compressed", CompressedImage, 25.0, RIG, "JPEG preview")
TRACKED_MARKERS = _topic(
    "tracker/markers", PointCloud2, 200.0, TRACKER, "measured markers, one message per frame"
)
FEM_MARKERS = _topic("fem/markers", PointCloud2, 50.0, FEM, "markers of the solver in step")
FEM_CABLE = _topic("fem/cable", PointCloud2, 20.0, FEM, "centreline with tension and strain")
FEM_CABLE_LINE = _topic("fem/cable_line", Marker, 20.0, FEM, "centreline as a LINE_STRIP for RViz")
FEM_PREDICTION = _topic(
    "fem/prediction", PointCloud2, None, FEM, "final markers of the run, ahead of it", latched=True
)
FEM_MATERIAL = _topic(
    "fem/material",
    DiagnosticArray,
    None,
    FEM,
    "effective modulus that the tracked markers tell, with its error",
    latched=True,
)
CORRECTED_MARKERS = _topic(
    "correction/markers",
    PointCloud2,
    50.0,
    CORRECTION,
    "predicted lengths times the correction factor h",
)
CORRECTION_CASE = _topic(
    "correction/case",
    DiagnosticArray,
    None,
    CORRECTION,
    "known condition that this run resembles, with its share of votes",
    latched=True,
)
EVERY_NODE = "every node"
DIAGNOSTICS = _topic("/diagnostics", DiagnosticArray, None, EVERY_NODE, "state of each node")
RECORDER_PROGRESS = _topic(
    "recorder/progress",
    Header,
    50.0,
    RECORDER,
    "stamp up to which the recorder has stored the fast topics",
    recorded=False,
)

TOPICS: tuple[Topic, ...] = (
    CLOCK,
    JOINT_STATES,
    JOINT_COMMANDS,
    TENSION,
    IMAGE,
    CAMERA_INFO,
    PREVIEW,
    TRACKED_MARKERS,
    FEM_MARKERS,
    FEM_CABLE,
    FEM_CABLE_LINE,
    FEM_PREDICTION,
    FEM_MATERIAL,
    CORRECTED_MARKERS,
    CORRECTION_CASE,
    DIAGNOSTICS,
    RECORDER_PROGRESS,
)

# Name -> (type, what it does).
SERVICES = {
    "rig/start": ("std_srvs/srv/Trigger", "start or resume winding"),
    "rig/stop": ("std_srvs/srv/Trigger", "ramp both axes down and hold"),
    "rig/quick_stop": (
        "std_srvs/srv/Trigger",
        "bring both axes to rest in 0.3 s, whatever the readers do; rig/start resumes",
    ),
    "rig/reset": (
        "std_srvs/srv/Trigger",
        "back to the start of the run, a latched stop released; only while stopped",
    ),
    "rig/emergency_stop": ("std_srvs/srv/Trigger", "cut the drives at once"),
    "camera/set_camera_info": (
        "sensor_msgs/srv/SetCameraInfo",
        "take a new calibration; every later camera_info carries it",
    ),
}

RECORD = "recorder/record"
# Served by the recorder of a run that an operator conducts.
RECORDER_SERVICES = {
    RECORD: (
        "std_srvs/srv/SetBool",
        "record into a further bag of the run's folder, or close the one that is being recorded; "
        "in a run with an operator's page",
    ),
}
