"""`winding serve`: goal, feedback, cancel and result over DDS, with a run in its own process."""

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from action_msgs.srv import CancelGoal
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from winding_cli.cell.goals import GoalError, Goals, GoalState, typed
from winding_cli.commands.serve import check_goal
from winding_ros import services, topics

NAMESPACE = "served"


def test_options_become_words_of_the_command_line() -> None:
    assert typed({"case": 4, "duration_s": 2.5, "camera": False, "rolling": True}) == [
        "--case", "4", "--duration-s", "2.5", "--no-camera", "--rolling",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("goal", "sentence"),
    [
        ({"case": 13}, "case must be one of 1 to 12, got 13"),
        ({"case": 4, "colour": "red"}, "a goal has no parameter colour"),
        ({"case": 4, "output": "/etc"}, "a goal has no parameter output"),
    ],
)
def test_a_goal_that_no_run_takes_is_refused(goal: dict[str, object], sentence: str) -> None:
    with pytest.raises(GoalError, match=sentence):
        check_goal(goal)


def goals(script: str, folder: Path) -> Goals:
    return Goals([sys.executable, "-c", script], folder, time.time_ns)


def test_a_run_that_fails_is_aborted_with_its_last_words(tmp_path: Path) -> None:
    taken = goals("print('began'); raise SystemExit('no driver is heard')", tmp_path)
    goal = taken.send({})
    taken.wait()
    assert (goal.state, goal.news, goal.result()) == (
        GoalState.ABORTED, "no driver is heard", None,
    )  # fmt: skip


def test_a_second_goal_waits_for_the_end_of_the_first(tmp_path: Path) -> None:
    taken = goals("import signal; signal.pause()", tmp_path)
    first = taken.send({})
    with pytest.raises(GoalError, match="is executing; cancel it first"):
        taken.send({})
    taken.close()
    assert first.state is GoalState.CANCELED
    assert taken.send({}).id != first.id
    taken.close()


@pytest.fixture
def server(tmp_path: Path) -> Iterator[None]:
    process = subprocess.Popen(
        [sys.executable, "-m", "winding_cli.cli", "serve", "--namespace", NAMESPACE,
         "--output", str(tmp_path / "runs")],
        stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout is not None
    try:
        assert any("waiting for goals" in line for line in process.stdout)
        yield
        process.terminate()
        assert process.wait(120.0) in (0, 130)
    finally:
        process.kill()


@pytest.mark.processes
@pytest.mark.timeout(600)
def test_a_goal_is_wound_with_feedback_and_a_result(server: None, ros: Any) -> None:
    node = ros.plain("controller")
    states: list[int] = []
    feedback: list[Any] = []
    for topic, heard in (
        (topics.RUN_STATUS, lambda m: states.append(m.status_list[0].status)),
        (topics.RUN_FEEDBACK, feedback.append),
    ):
        node.create_subscription(topic.type, f"/{NAMESPACE}/{topic.name}", heard, topic.qos)

    def call(service: Any, request: Any) -> Any:
        return ros.call(node, service.type, f"/{NAMESPACE}/{service.name}", request)

    goal = SetParametersAtomically.Request(
        parameters=[
            Parameter(name, value=value).to_parameter_msg()
            for name, value in {"case": 4, "duration_s": 2.0, "speed": 0.0}.items()
        ]
    )
    refused = call(services.GET_RESULT, Trigger.Request())
    assert (refused.success, refused.message) == (False, "no goal has ended")
    answer = call(services.SEND_GOAL, goal)
    assert answer.result.successful, answer.result.reason
    assert not call(services.SEND_GOAL, goal).result.successful
    ros.spin_until(lambda: GoalStatus.STATUS_SUCCEEDED in states, patience=400.0)
    assert states[0] == GoalStatus.STATUS_EXECUTING
    assert any("simulated" in message.status[0].message for message in feedback)
    result = call(services.GET_RESULT, Trigger.Request())
    assert result.success
    assert json.loads(result.message)["joint_states"] == 2001
    late = call(services.CANCEL_GOAL, CancelGoal.Request())
    assert late.return_code == CancelGoal.Response.ERROR_GOAL_TERMINATED
