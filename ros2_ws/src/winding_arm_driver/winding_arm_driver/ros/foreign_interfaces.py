"""Interfaces that not every installation has: transforms, and goals of trajectories."""

import importlib
import math
from collections.abc import Callable
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory

from winding_core.arm.arm_file import MappingError

# A goal that was not answered for so long is given up: its server has ended [s].
_UNANSWERED = 1.0


def interface(package: str, kind: str, name: str, *, needing: str, otherwise: str) -> Any:
    """Return an interface of a package that is imported only where it is needed.

    Args:
        package: As `tf2_msgs`.
        kind: `msg` or `action`.
        name: Of the interface.
        needing: Setting of the mapping that needs it.
        otherwise: Settings that do without.

    Raises:
        MappingError: The package is not installed.
    """
    try:
        return getattr(importlib.import_module(f"{package}.{kind}"), name)
    except ImportError:
        raise MappingError(
            f"{needing} needs the interfaces of {package}, which are not installed (on ROS 2 "
            f"Jazzy: ros-jazzy-{package.replace('_', '-')}); take {otherwise}"
        ) from None


class TrajectoryGoals:
    """Sends trajectories as goals of a FollowJointTrajectory; each takes over from the last one.

    Args:
        node: Whose client it is.
        name: Of the action.
        clock: Monotonic time [s].
        refuse: Takes why a trajectory was not followed.

    Raises:
        MappingError: `control_msgs` is not installed.
    """

    def __init__(
        self, node: Node, name: str, clock: Callable[[], float], refuse: Callable[[str], None]
    ) -> None:
        self._type = interface(
            "control_msgs",
            "action",
            "FollowJointTrajectory",
            needing="type action",
            otherwise="type trajectory or positions",
        )
        self._client = ActionClient(node, self._type, name)
        self._name, self._clock, self._refuse = name, clock, refuse
        self._sent = -math.inf

    def publish(self, trajectory: JointTrajectory) -> None:
        """Send a trajectory, unless the answer to the last one is still to come."""
        if not self._client.server_is_ready():
            self._refuse(f"there is no action server {self._name}")
        elif self._clock() - self._sent > _UNANSWERED:
            self._sent = self._clock()
            goal = self._type.Goal(trajectory=trajectory)
            self._client.send_goal_async(goal).add_done_callback(self._answered)

    def _answered(self, future: Any) -> None:
        self._sent = -math.inf
        if future.result().accepted:
            future.result().get_result_async().add_done_callback(self._ended)
        else:
            self._refuse(f"{self._name} rejected a trajectory")

    def _ended(self, future: Any) -> None:
        response = future.result()
        if response.status == GoalStatus.STATUS_ABORTED:
            result = response.result
            why = result.error_string or f"error code {result.error_code}"
            self._refuse(f"{self._name} aborted a trajectory: {why}")
