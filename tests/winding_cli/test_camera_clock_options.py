"""What is done about the camera's clock is an option of the commands that track."""

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from winding_cli.commands.run import run
from winding_cli.commands.track import track
from winding_core.parameters import declarations, options
from winding_core.run_options import CameraClockParameters
from winding_ros import graph


def test_the_tracker_has_every_parameter() -> None:
    wanted = {item.name for item in declarations(CameraClockParameters)}
    assert {item.name for item in declarations(graph.parameters_of(graph.TRACKER))} >= wanted


@pytest.mark.parametrize("command", [run, track], ids=lambda command: command.__name__)
def test_both_commands_take_every_option(command: Callable[..., None]) -> None:
    keys = set(options(CameraClockParameters))
    assert keys == {"camera_clock_correction", "camera_clock_limit_ms"}
    assert set(inspect.signature(command).parameters) >= keys


def test_a_limit_out_of_range_is_refused_before_anything_starts(
    command: Callable[..., Any], tmp_path: Path
) -> None:
    done = command("run", "--case", 4, "--camera-clock-limit-ms", 5000, cwd=tmp_path)
    assert done.returncode == 2
    assert "--camera-clock-limit-ms must be at most 2000, got 5000" in done.stderr
    assert done.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())
