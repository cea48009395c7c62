"""Goal, feedback, cancel and result of runs, with the message types of stock Jazzy."""

import json
from collections.abc import Callable, Mapping
from typing import Any

from action_msgs.msg import GoalStatus, GoalStatusArray
from action_msgs.srv import CancelGoal
from rclpy.node import Node
from rclpy.parameter import Parameter
from unique_identifier_msgs.msg import UUID

from winding_cli.cell.goals import Goal, GoalError, Goals
from winding_core.status import Level, Status
from winding_ros import services, topics
from winding_ros.messages.diagnostics import encode_diagnostics
from winding_ros.messages.stamps import encode_stamp

_PERIOD = 0.5


class GoalServer:
    """A cell controller's way to runs.

    Args:
        node: Node `run_server`, in the namespace of the graph.
        goals: What is executed.
        check: Raises GoalError for options that no run takes.
    """

    def __init__(
        self, node: Node, goals: Goals, check: Callable[[Mapping[str, object]], None]
    ) -> None:
        self._node, self._goals, self._check = node, goals, check
        self._lengths: dict[str, str] = {}
        self._reported: tuple[bytes, int] | None = None
        self._status = topics.RUN_STATUS.advertise(node)
        self._feedback = topics.RUN_FEEDBACK.advertise(node)
        services.SEND_GOAL.serve(node, self._send)
        services.CANCEL_GOAL.serve(node, self._cancel)
        services.GET_RESULT.serve(node, self._result)
        topics.CORRECTED_MARKERS.subscribe(node, self._note_lengths)
        node.create_timer(_PERIOD, self._report)

    def _send(self, request: Any, response: Any) -> Any:
        given = map(Parameter.from_parameter_msg, request.parameters)
        options = {item.name: item.value for item in given}
        try:
            self._check(options)
            goal = self._goals.send(options)
        except GoalError as error:
            response.result.reason = str(error)
            return response
        self._lengths = {}
        response.result.successful = True
        response.result.reason = str(goal.id)
        self._report()
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
        self._report()
        return response

    def _result(self, _request: Any, response: Any) -> Any:
        goal = self._goals.goal
        if goal is None or not goal.state.ended:
            response.message = "no goal has ended" if goal is None else "the goal is executing"
            return response
        found = goal.result()
        response.success = found is not None
        left = f"{goal.news}; the run's folder is {goal.folder}"
        response.message = left if found is None else json.dumps(found)
        return response

    def _report(self) -> None:
        goal = self._goals.goal
        if goal is None:
            return
        state = (goal.id.bytes, int(goal.state))
        if state != self._reported:
            self._status.publish(GoalStatusArray(status_list=[_status(goal)]))
        elif goal.state.ended:
            return
        self._reported = state
        values = {"goal_id": str(goal.id), "state": goal.state.name, **self._lengths}
        status = Status(name=topics.RUN_SERVER, level=Level.OK, message=goal.news, values=values)
        now = self._node.get_clock().now().nanoseconds * 1e-9
        self._feedback.publish(
            encode_diagnostics(now, [status], hardware_id=self._node.get_namespace())
        )

    def _note_lengths(self, message: Any) -> None:
        _, markers = topics.CORRECTED_MARKERS.decode(message)
        for marker in markers:
            if marker["id"] > 0:
                name = f"P{marker['id']}"
                self._lengths[f"{name} predicted_m"] = f"{marker['s_fem']:.5f}"
                self._lengths[f"{name} corrected_m"] = f"{marker['s']:.5f}"


def is_served(node: Node, patience: float) -> bool:
    """Return whether another node serves goals in the node's namespace.

    Args:
        node: Of a context of its own.
        patience: Longest wait for discovery [s].
    """
    client = services.SEND_GOAL.client(node)
    try:
        return bool(client.wait_for_service(timeout_sec=patience))
    finally:
        node.destroy_client(client)


def _status(goal: Goal) -> GoalStatus:
    status = GoalStatus(status=int(goal.state))
    status.goal_info.goal_id = UUID(uuid=list(goal.id.bytes))
    status.goal_info.stamp = encode_stamp(goal.accepted_ns * 1e-9)
    return status
