"""The orchestrator describes the machine to whoever comes, early or late."""

import math
from pathlib import Path
from typing import Any

from winding_core.cable.condition import Condition
from winding_core.machine.axes import MachineAxes
from winding_core.run_options import CameraPlacement
from winding_core.urdf import machine_urdf
from winding_ros import topics
from winding_supervisor.session.run_config import RunConfig
from winding_supervisor.session.run_parts import describe_machine


def config(tmp_path: Path) -> RunConfig:
    return RunConfig(
        directory=tmp_path,
        condition={"case": 8},
        own={topics.TRACKER: {"camera_position": [0.5, 0.0, 0.1]}},
        duration=20.0,
    )


def test_a_late_subscriber_gets_the_machine_of_the_run(ros: Any, tmp_path: Path) -> None:
    reported: list[str] = []
    describe_machine(
        config(tmp_path), {"cylinder_offset": 37.2}, ros.plain("orchestrator"), reported.append
    )
    heard: list[Any] = []
    topics.ROBOT_DESCRIPTION.subscribe(ros.plain("late"), heard.append)
    ros.spin_until(lambda: heard)
    assert heard[0].data == machine_urdf(
        Condition(case=8).resolved(),
        MachineAxes(cylinder_offset=37.2),
        CameraPlacement(camera_position=[0.5, 0.0, 0.1]),
    )
    assert reported == []


def test_a_machine_without_a_urdf_is_reported(ros: Any, tmp_path: Path) -> None:
    reported: list[str] = []
    axes = {"carriage_scale": math.pi}
    describe_machine(config(tmp_path), axes, ros.plain("orchestrator"), reported.append)
    assert reported == [
        "no robot_description: a URDF joint is in rad or m: carriage_scale must be 1 or -1, "
        "got 3.14159"
    ]
