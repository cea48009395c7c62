"""`winding serve`: goal, feedback, cancel and result over DDS, with a run in its own process."""

import json
import math
import subprocess
import sys
import time
from array import array
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
from winding_core.run_spec import SECTION_OF
from winding_ros import services, topics

NAMESPACE = "served"


def test_options_become_words_of_the_command_line() -> None:
    goal = {"case": 4, "duration_s": 2.5, "camera": False, "rolling": True}
    assert typed({**goal, "camera_position_mm": array("d", [1.5, 0.0, -2.0])}) == [
        "--case=4", "--duration-s=2.5", "--no-camera", "--rolling",
        "--camera-position-mm=1.5,0.0,-2.0",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("goal", "sentence"),
    [
        ({"case": 13}, "case must be one of 1 to 12, got 13"),
        ({"case": 4, "colour": "red"}, "a goal has no parameter colour"),
        ({"case": 4, "cylinder_scale": math.nan}, "cylinder_scale must be finite, got nan"),
        ({"case": 4, "control": "ram"}, "control must be one of off, watch, drive, got 'ram'"),
        ({"case": 4, "young_mpa": None}, "young_mpa has no value"),
        ({"case": 4, "speed": "fast"}, "speed must be a float, got 'fast'"),
        ({"case": 4, "camera": 1}, "camera must be a bool, got 1"),
        ({"case": 4, "machine": "external\0"}, "machine must be one of simulated, external, got"),
        ({"case": 4, "machine": "external", "start": "a\0b"}, "start must be one of"),
        (
            {"case": 2, "weights": "/srv/mine"},
            "weights must be one of rod, .*, got '/srv/mine': a goal",
        ),
        ({"case": 2, "weights": "../rod"}, "weights must be one of rod"),
        ({"cable": "mine.yaml"}, "a cable's name is of letters, .*, got 'mine.yaml'"),
        ({"cable": "../hose"}, "a cable's name is of letters"),
        ({"cable": "hse"}, "the library has no cable 'hse'; did you mean hose?"),
        ({"case": 2, "remark": "a\nb"}, "remark must be printable"),
    ],
)
def test_a_goal_that_no_run_takes_is_refused(goal: dict[str, object], sentence: str) -> None:
    with pytest.raises(GoalError, match=sentence):
        check_goal(goal)


def test_a_goal_sets_nothing_that_names_a_file_code_or_a_place() -> None:
    places, taken = set(), set()
    for name in SECTION_OF:
        try:
            check_goal({"case": 5, name: "/srv/there"})
            taken.add(name)
        except GoalError as error:
            if str(error) == f"a goal cannot set {name}: files, code and places are the server's":
                places.add(name)
    assert places >= {
        *("program", "truth", "bag", "compression", "split_mb", "output", "report", "json"),
        *("trace", "compose", "parameters", "domain", "namespace", "dashboard", "dashboard_port"),
        "library",
    }
    assert not taken & places
    labels = {"machine_name", "batch", "operator", "remark"}
    assert taken <= {"lay", "marker_colours", "cylinder_joint", "carriage_joint", *labels}


def test_a_goal_sets_how_it_is_wound() -> None:
    check_goal({"case": 7, "duration_s": 3, "speed": 0, "weights": "paper", "lay": "fem"})
    check_goal({"case": 2, "machine": "external", "turns": 2.5, "camera_position_mm": "1,2,3"})
    check_goal({"cable": "hose", "duration_s": 3.0, "batch": "B7", "operator": "Ann"})


def goals(script: str, folder: Path) -> Goals:
    return Goals([sys.executable, "-c", script], folder, time.time_ns)


def test_a_run_that_fails_is_aborted_with_its_last_words(tmp_path: Path) -> None:
    taken = goals("print('began'); raise SystemExit('no driver is heard')", tmp_path)
    goal = taken.send({})
    taken.wait()
    assert (goal.state, goal.news, goal.result()) == (
        GoalState.ABORTED, "no driver is heard", None,
    )  # fmt: skip


def test_a_goal_without_a_process_is_refused_and_the_next_is_taken(tmp_path: Path) -> None:
    taken = Goals([str(tmp_path / "no such command")], tmp_path, time.time_ns)
    for _ in range(2):
        with pytest.raises(GoalError, match="no process can be started: No such file"):
            taken.send({"case": 3})
    assert taken.goal is None


def test_a_run_is_recorded_beside_its_numbers_and_the_result_names_it(tmp_path: Path) -> None:
    script = """
import json, sys
from pathlib import Path
folder = Path(sys.argv[-2].removeprefix("--output="))
folder.mkdir(parents=True)
(folder / "run.json").write_text(json.dumps({"words": sys.argv[1:]}))
"""
    taken = Goals([sys.executable, "-c", script], tmp_path, time.time_ns, record=True)
    goal = taken.send({"case": 3})
    taken.wait()
    assert goal.result() == {
        "folder": str(goal.folder),
        "words": ["--case=3", f"--output={goal.folder}", f"--bag={goal.folder}/bag"],
    }


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
def server(tmp_path: Path) -> Iterator[Path]:
    process = subprocess.Popen(
        [sys.executable, "-m", "winding_cli.cli", "serve", "--namespace", NAMESPACE,
         "--output", str(tmp_path / "runs")],
        stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout is not None
    try:
        assert any("waiting for goals" in line for line in process.stdout)
        yield tmp_path / "runs"
        process.terminate()
        assert process.wait(120.0) in (0, 130)
    finally:
        process.kill()


@pytest.mark.processes
@pytest.mark.timeout(600)
def test_a_goal_is_wound_with_feedback_and_a_result(
    server: Path, ros: Any, command: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    second = command("serve", "--namespace", NAMESPACE, cwd=server.parent, code=2)
    assert f"already has a server of goals in namespace /{NAMESPACE}" in second.stderr
    # Another user, or a container, has other locks.
    monkeypatch.setenv("TMPDIR", str(server.parent))
    third = command("serve", "--namespace", NAMESPACE, cwd=server.parent, code=2)
    assert f"has a server of goals in /{NAMESPACE}" in third.stderr
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
    numbers = json.loads(result.message)
    assert numbers["joint_states"] == 2001
    assert [Path(numbers["folder"])] == list(server.iterdir())
    late = call(services.CANCEL_GOAL, CancelGoal.Request())
    assert late.return_code == CancelGoal.Response.ERROR_GOAL_TERMINATED
