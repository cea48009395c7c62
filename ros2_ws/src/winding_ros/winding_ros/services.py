"""Every service of the graph, declared once: name, type, who serves it, what it does."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from action_msgs.srv import CancelGoal
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.node import Node
from sensor_msgs.srv import SetCameraInfo
from std_srvs.srv import SetBool, Trigger

from winding_ros.topics import LAY_CONTROL, ORCHESTRATOR, RECORDER, RIG, RUN_SERVER


@dataclass(frozen=True, kw_only=True)
class Service:
    """One service of the graph contract; the lifecycle and parameter services come from rclpy."""

    name: str  # Relative to the graph's namespace.
    type: Any  # Service class.
    server: str  # Name of the node that serves it.
    description: str  # One line for the interface table.

    @property
    def type_name(self) -> str:
        """Full ROS name of the type."""
        package, kind, *_ = self.type.__module__.split(".")
        return f"{package}/{kind}/{self.type.__name__}"

    def serve(self, node: Node, callback: Callable[[Any, Any], Any]) -> None:
        """Serve it on a node."""
        node.create_service(self.type, self.name, callback)

    def client(self, node: Node) -> Any:
        """Return a client of the service on a node."""
        return node.create_client(self.type, self.name)


def _service(name: str, type_: type, server: str, description: str) -> Service:
    return Service(name=name, type=type_, server=server, description=description)


START = _service("rig/start", Trigger, RIG, "start or resume winding")
STOP = _service("rig/stop", Trigger, RIG, "ramp both axes down and hold")
QUICK_STOP = _service(
    "rig/quick_stop",
    Trigger,
    RIG,
    "bring both axes to rest in 0.3 s, whatever the readers do; rig/start resumes",
)
RESET = _service(
    "rig/reset",
    Trigger,
    RIG,
    "back to the start of the run, a latched stop released; only while stopped. Active listeners "
    "go on with the run that was: deactivate and activate them before the next start, as Reset of "
    "the page does",
)
EMERGENCY_STOP = _service("rig/emergency_stop", Trigger, RIG, "cut the drives at once")
SET_CAMERA_INFO = _service(
    "camera/set_camera_info",
    SetCameraInfo,
    RIG,
    "take a new calibration; every later camera_info carries it",
)
LAY_CONTROL_OFF = _service(
    "lay_control/off",
    Trigger,
    LAY_CONTROL,
    "command nothing; a carriage that was driven goes on by the drive programme",
)
LAY_CONTROL_WATCH = _service(
    "lay_control/watch", Trigger, LAY_CONTROL, "as off, and report what would be commanded"
)
LAY_CONTROL_DRIVE = _service(
    "lay_control/drive", Trigger, LAY_CONTROL, "command guide and brake from where they are"
)
# Served by the recorder of a run that an operator conducts.
RECORD = _service(
    "recorder/record",
    SetBool,
    RECORDER,
    "record into a further bag of the run's folder, or close the one that is being recorded; "
    "in a run with an operator's page",
)

NEXT_RUN = _service(
    "orchestrator/next_run",
    Trigger,
    ORCHESTRATOR,
    "reset a machine that stands and make the nodes ready for another run that begins there; for "
    "a machine with a driver of its own, in a run with an operator's page",
)

# Served between runs, too: a cell controller's way to them.
SEND_GOAL = _service(
    "run/send_goal",
    SetParametersAtomically,
    RUN_SERVER,
    "wind: options of `winding run` by name; the answer's reason is the goal's id or the refusal",
)
CANCEL_GOAL = _service("run/cancel_goal", CancelGoal, RUN_SERVER, "interrupt the run")
GET_RESULT = _service(
    "run/get_result", Trigger, RUN_SERVER, "run.json of the goal that has ended, as text"
)

# In the order of their declaration.
SERVICES: tuple[Service, ...] = tuple(
    item for item in globals().values() if isinstance(item, Service)
)


def served_by(node: str) -> tuple[str, ...]:
    """Return the names of the services that a node serves."""
    return tuple(service.name for service in SERVICES if service.server == node)
