"""Every topic of the graph, declared once: name, type, rate, publisher, recorded, content."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from action_msgs.msg import GoalStatusArray
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, JointState, PointCloud2
from std_msgs.msg import Header, String
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import Marker

from winding_core.lay.records import LAY_CONTROL_DTYPE, LAY_DTYPE
from winding_core.machine.readings import CABLE_TENSION, Quantity
from winding_core.markers import CABLE_DTYPE, CORRECTED_DTYPE, MARKER_DTYPE
from winding_core.trace import TRACE_DTYPE
from winding_ros.messages.camera import decode_camera_info, decode_image, decode_preview
from winding_ros.messages.clouds import decode_cloud, decode_line_width
from winding_ros.messages.commands import decode_targets, decode_tension_command, decode_trajectory
from winding_ros.messages.diagnostics import decode_case_votes, decode_diagnostics, decode_material
from winding_ros.messages.rig import decode_clock, decode_joint_state, decode_quantity
from winding_ros.messages.stamps import decode_stamp
from winding_ros.topic import Topic

# Reliable delivery keeps what a stalled reader has not taken yet: depth is rate x worst stall.
WORST_STALL_S = 2.0
FASTEST_DRIVER = 2000.0  # Encoders of real machines are read at up to this rate [Hz]
FASTEST_CAMERA = 1000.0  # A camera in the tracker's process may take so many frames a second [Hz]


def _topic(
    name: str,
    type_: type,
    rate: float | None,
    publisher: str,
    description: str,
    decode: Callable[[Any], tuple[float, Any]],
    *,
    fastest: float = 0.0,
    **further: Any,
) -> Topic:
    """Return a topic whose readers keep what comes within the worst stall.

    Args:
        name: Relative to the namespace, or absolute.
        type_: Message class.
        rate: Nominal, of the simulated machine's topics [Hz].
        publisher: Node.
        description: One line.
        decode: Makes (t [s], content) of a message.
        fastest: Rate at which a real machine's driver may publish it, where that is more [Hz].
        further: Fields of `Topic`.
    """
    return Topic(
        name=name,
        type=type_,
        rate=rate,
        publisher=publisher,
        depth=further.pop("depth", max(10, int(max(rate or 0.0, fastest) * WORST_STALL_S))),
        description=description,
        decode=decode,
        **further,
    )


def _measured(name: str, type_: type, rate: float, description: str, quantity: Quantity) -> Topic:
    """Return a topic of the rig whose messages carry one number of a sensor."""
    decode = partial(decode_quantity, quantity)
    return _topic(
        name, type_, rate, RIG, description, decode, fastest=FASTEST_DRIVER, quantity=quantity
    )


def _records(dtype: np.dtype[np.void]) -> Callable[[Any], tuple[float, Any]]:
    return partial(decode_cloud, dtype=dtype)


RIG, TRACKER, FEM, CORRECTION = "winding_rig", "marker_tracker", "cable_fem", "correction"
LAY_CONTROL = "lay_control"
RECORDER, DASHBOARD, ORCHESTRATOR = "recorder", "dashboard", "orchestrator"
# Takes goals of a cell controller, each of which is a run.
RUN_SERVER = "run_server"
EVERY_NODE = "every node"
COMMANDER = "commander"  # Whoever commands the axes from outside the graph; a run does without

CLOCK = _topic("/clock", Clock, 100.0, RIG, "simulated time", decode_clock)
JOINT_STATES = _topic(
    "rig/joint_states",
    JointState,
    1000.0,
    RIG,
    "encoder samples of cylinder and carriage, and the place of a guide that moves across the axis",
    decode_joint_state,
    fastest=FASTEST_DRIVER,
)
JOINT_COMMANDS = _topic(
    "rig/joint_commands",
    JointState,
    50.0,
    RIG,
    "setpoints of cylinder and carriage",
    decode_joint_state,
)
JOINT_TARGETS = _topic(
    "rig/joint_targets",
    JointState,
    None,
    COMMANDER,
    "positions or velocities for one or both axes; NaN for what is not commanded",
    decode_targets,
    # As controllers send it: what has been replaced is not worth taking.
    depth=1,
)
JOINT_TRAJECTORY = _topic(
    "rig/joint_trajectory",
    JointTrajectory,
    None,
    COMMANDER,
    "trajectory of one or both axes; without points they hold",
    decode_trajectory,
)
TENSION_COMMAND = _topic(
    "rig/tension_command",
    WrenchStamped,
    None,
    COMMANDER,
    "pull of the brake on the cable, force.x [N]",
    decode_tension_command,
    depth=1,
)
TENSION = _measured(
    "rig/tension", WrenchStamped, 100.0, "load cell at the guide, force.x [N]", CABLE_TENSION
)
IMAGE = _topic("camera/image_raw", Image, 200.0, RIG, "windowed camera frames, bgr8", decode_image)
CAMERA_INFO = _topic(
    "camera/camera_info",
    CameraInfo,
    200.0,
    RIG,
    "full-resolution calibration, window and binning",
    decode_camera_info,
    fastest=FASTEST_CAMERA,
)
PREVIEW = _topic(
    "camera/image_raw/compressed", CompressedImage, 25.0, RIG, "JPEG preview", decode_preview
)
TRACKED_MARKERS = _topic(
    "tracker/markers",
    PointCloud2,
    200.0,
    TRACKER,
    "measured markers, one message per frame",
    _records(MARKER_DTYPE),
    fastest=FASTEST_CAMERA,
    answer=True,
)
TRACKED_LAY = _topic(
    "tracker/lay",
    PointCloud2,
    10.0,
    TRACKER,
    "newest twelve turns as measured, every 5 degrees; unless measure_lay is false",
    _records(LAY_DTYPE),
)
FEM_MARKERS = _topic(
    "fem/markers",
    PointCloud2,
    50.0,
    FEM,
    "markers of the solver in step",
    _records(MARKER_DTYPE),
    answer=True,
)
FEM_CABLE = _topic(
    "fem/cable",
    PointCloud2,
    20.0,
    FEM,
    "centreline with tension and strain: the span, all that moves, the newest twelve turns",
    _records(CABLE_DTYPE),
)
FEM_CABLE_LINE = _topic(
    "fem/cable_line",
    Marker,
    20.0,
    FEM,
    "centreline of the same nodes as a LINE_STRIP for RViz",
    decode_line_width,
)
FEM_PREDICTION = _topic(
    "fem/prediction",
    PointCloud2,
    None,
    FEM,
    "markers of the run, ahead of it: as far as it is predicted, in the end all",
    _records(MARKER_DTYPE),
    latched=True,
)
FEM_MATERIAL = _topic(
    "fem/material",
    DiagnosticArray,
    None,
    FEM,
    "effective modulus from the tracked markers, with its error",
    decode_material,
    latched=True,
)
CORRECTED_MARKERS = _topic(
    "correction/markers",
    PointCloud2,
    50.0,
    CORRECTION,
    "predicted lengths times the correction factor h",
    _records(CORRECTED_DTYPE),
    answer=True,
)
CORRECTION_CASE = _topic(
    "correction/case",
    DiagnosticArray,
    None,
    CORRECTION,
    "known condition that this run resembles, with its share of votes",
    decode_case_votes,
    latched=True,
)
LAY_CONTROL_STATE = _topic(
    "lay_control/state",
    PointCloud2,
    50.0,
    LAY_CONTROL,
    "where the cable lands, where it is wanted, and what is commanded for it, or would be",
    _records(LAY_CONTROL_DTYPE),
    answer=True,
)
TRACE = _topic(
    "trace",
    PointCloud2,
    None,
    EVERY_NODE,
    "instants on the way of each corrected length; only while there is a subscription",
    _records(TRACE_DTYPE),
    recorded=False,
    depth=1000,
)
DIAGNOSTICS = _topic(
    "/diagnostics", DiagnosticArray, None, EVERY_NODE, "state of each node", decode_diagnostics
)
RECORDER_PROGRESS = _topic(
    "recorder/progress",
    Header,
    50.0,
    RECORDER,
    "stamp up to which the recorder has stored the fast topics",
    lambda header: (decode_stamp(header.stamp), None),
    recorded=False,
    answer=True,
)
RUN_STATUS = _topic(
    "run/status",
    GoalStatusArray,
    None,
    RUN_SERVER,
    "state of the newest goal of `winding serve`",
    lambda message: (0.0, message.status_list),
    latched=True,
    recorded=False,
)
RUN_FEEDBACK = _topic(
    "run/feedback",
    DiagnosticArray,
    2.0,
    RUN_SERVER,
    "progress of the goal and the lengths so far",
    decode_diagnostics,
    recorded=False,
)
ROBOT_DESCRIPTION = _topic(
    "robot_description",
    String,
    None,
    ORCHESTRATOR,
    "the machine as URDF; its joints are those of rig/joint_states",
    lambda text: (0.0, text.data),
    latched=True,
    # Without a stamp it has no place in a bag.
    recorded=False,
    depth=1,
)

# In the order of their declaration.
TOPICS: tuple[Topic, ...] = tuple(item for item in globals().values() if isinstance(item, Topic))


def published_by(node: str) -> tuple[Topic, ...]:
    """Return the topics that a node alone publishes."""
    return tuple(topic for topic in TOPICS if topic.publisher == node)
