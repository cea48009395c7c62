"""Goal, feedback, cancel and result of runs, with the message types of stock Jazzy."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

from action_msgs.msg import GoalStatus, GoalStatusArray
from action_msgs.srv import CancelGoal
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from unique_identifier_msgs.msg import UUID

from winding_cli.cell.goals import Goal, GoalError, Goals
from winding_core.markers import CORRECTED_DTYPE
from winding_core.status import Level, Status
from winding_ros import services, topics
from winding_ros.cloud_messages import decode_cloud
from winding_ros.diagnostic_messages import encode_diagnostics
from winding_ros.environment import ros_arguments
from winding_ros.stamps import encode_stamp

_PERIOD = 0.5


class GoalNode(Node):  # type: ignore[misc]
    """Node `run_server`: a cell controller's way to runs.

    Args:
        namespace: Of the graph.
        context: Of the node.
        goals: What is executed.
        check: Raises GoalError for options that no run takes.
    """

    def __init__(
        self,
        namespace: str,
        context: Context,
        goals: Goals,
        check: Callable[[Mapping[str, object]], None],
    ) -> None:
        super().__init__(topics.RUN_SERVER, context=context, cli_args=ros_arguments(namespace))
        self._goals = goals
        self._check = check
        self._lengths: dict[str, str] = {}
        self._told: tuple[bytes, int] | None = None
        self._status = topics.RUN_STATUS.advertise(self)
        self._feedback = topics.RUN_FEEDBACK.advertise(self)
        services.SEND_GOAL.serve(self, self._send)
        services.CANCEL_GOAL.serve(self, self._cancel)
        services.GET_RESULT.serve(self, self._result)
        topics.CORRECTED_MARKERS.subscribe(self, self._note_lengths)
        self.create_timer(_PERIOD, self._tell)

    def _send(self, request: Any, response: Any) -> Any:
        stated = map(Parameter.from_parameter_msg, request.parameters)
        options = {item.name: item.value for item in stated}
        try:
            self._check(options)
            goal = self._goals.send(options)
        except GoalError as error:
            response.result.reason = str(error)
            return response
        self._lengths = {}
        response.result.successful = True
        response.result.reason = str(goal.id)
        self._tell()
        return response

    def _cancel(self, request: Any, response: Any) -> Any:
        goal = self._goals.goal
        wanted = bytes(request.goal_info.goal_id.uuid)
        if goal is None or (any(wanted) and wanted != goal.id.bytes):
            response.return_code = CancelGoal.Response.ERROR_UNKNOWN_GOAL_ID
        elif self._goals.cancel():
            response.goals_canceling = [_status(goal).goal_info]
        else:
            response.return_code = CancelGoal.Response.ERROR_GOAL_TERMINATED
        self._tell()
        return response

    def _result(self, _request: Any, response: Any) -> Any:
        goal = self._goals.goal
        if goal is None or not goal.state.ended:
            response.message = "no goal has ended" if goal is None else "the goal is executing"
            return response
        found = goal.result()
        response.success = found is not None
        response.message = goal.news if found is None else json.dumps(found)
        return response

    def _tell(self) -> None:
        goal = self._goals.goal
        if goal is None:
            return
        state = (goal.id.bytes, int(goal.state))
        if state != self._told:
            self._status.publish(GoalStatusArray(status_list=[_status(goal)]))
        elif goal.state.ended:
            return
        self._told = state
        values = {"goal_id": str(goal.id), "state": goal.state.name, **self._lengths}
        status = Status(name=topics.RUN_SERVER, level=Level.OK, message=goal.news, values=values)
        now = self.get_clock().now().nanoseconds * 1e-9
        self._feedback.publish(encode_diagnostics(now, [status], hardware_id=self.get_namespace()))

    def _note_lengths(self, message: Any) -> None:
        _, markers = decode_cloud(message, CORRECTED_DTYPE)
        for marker in markers:
            if marker["id"] > 0:
                name = f"P{marker['id']}"
                self._lengths[f"{name} predicted_m"] = f"{marker['s_fem']:.5f}"
                self._lengths[f"{name} corrected_m"] = f"{marker['s']:.5f}"


def _status(goal: Goal) -> GoalStatus:
    status = GoalStatus(status=int(goal.state))
    status.goal_info.goal_id = UUID(uuid=list(goal.id.bytes))
    status.goal_info.stamp = encode_stamp(goal.accepted_ns * 1e-9)
    return status


def spin(node: GoalNode, context: Context) -> None:
    """Serve goals until a KeyboardInterrupt; the node is destroyed then."""
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    try:
        while True:
            # A signal is only seen between two waits.
            executor.spin_once(timeout_sec=0.1)
    finally:
        executor.shutdown()
        node.destroy_node()
