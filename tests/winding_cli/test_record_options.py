"""What a record declares reaches nodes, commands, sweeps and the page under one name."""

import dataclasses
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from winding_cli.commands.identify import identify
from winding_cli.commands.plan import plan
from winding_cli.commands.predict import predict
from winding_cli.commands.render import render
from winding_cli.commands.run import run
from winding_cli.commands.track import track
from winding_core.cable.condition import Condition
from winding_core.markers import MarkerLook
from winding_core.parameters import declarations, option_kinds, options
from winding_core.run_options import CameraClockParameters
from winding_dashboard.page.condition_form import FIELDS, LAWS
from winding_ros.graph import GRAPH, RIG, TRACKER, parameters_of
from winding_study.run_parameters import RunParameters

NAMES = {item.name for item in dataclasses.fields(Condition)}
KEYS = set(options(Condition))
# Record -> nodes that have its parameters, commands that have its options.
TAKEN = {
    Condition: (GRAPH, (predict, plan, run, track, identify)),
    MarkerLook: ((RIG, TRACKER), (run, track, render)),
    CameraClockParameters: ((TRACKER,), (run, track)),
}


@pytest.mark.parametrize("record", TAKEN, ids=lambda record: record.__name__)
def test_every_parameter_is_one_of_the_nodes_and_an_option_of_the_commands(record: type) -> None:
    nodes, commands = TAKEN[record]
    names, keys = {item.name for item in declarations(record)}, set(options(record))
    assert {item.name for item in options(record).values()} == names
    assert len(keys) == len(names)
    for spec in nodes:
        assert {item.name for item in declarations(parameters_of(spec))} >= names, spec.name
    for command in commands:
        assert set(inspect.signature(command).parameters) >= keys, command.__name__


def test_every_field_of_the_condition_can_be_swept_and_is_one_of_the_page() -> None:
    assert {item.name for item in options(Condition).values()} == NAMES
    assert set(option_kinds(RunParameters)) >= KEYS
    assert set(FIELDS) | {"case", "law"} == KEYS
    assert set(LAWS) == set(options(Condition)["law"].choices or ())


def test_markers_and_the_camera_clock_have_these_options() -> None:
    assert set(options(MarkerLook)) == {"marker_kind", "band_mm", "dot_mm", "marker_colours"}
    assert set(options(CameraClockParameters)) == {
        "camera_clock_correction",
        "camera_clock_limit_ms",
    }


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (
            ("--camera-clock-limit-ms", 5000),
            "--camera-clock-limit-ms must be at most 2000, got 5000",
        ),
        (("--marker-colours", "pink"), "marker_colours must list red"),
        (("--row-time-us", 5), "--row-time-us is for the pictures of a real camera"),
        (
            ("--machine", "external", "--no-camera", "--measure-lay", "--encoding", "rgb8"),
            "--encoding and --measure-lay need a camera",
        ),
        (("--lay-tolerance-mm", 0.2), "--lay-tolerance-mm judges a wanted lay"),
        (("--control", "drive", "--lay-tolerance-mm", 0), "--lay-tolerance-mm must be positive"),
        (("--compose", "my_camera:open"), "the simulated machine has a camera of its own"),
        (("--compose", "camera", "--attach"), "compose its camera there"),
        (("--compose", "camera", "--secure"), "--compose and --secure exclude each other"),
        (("--frame-rate", 300), "--frame-rate must be 200 or 1000, got 300"),
        (("--machine", "external", "--compose", "nowhere.py:open"), "no camera at nowhere.py"),
        (
            ("--machine", "external", "--no-camera", "--compose", "json:load"),
            "--compose and --no-camera exclude each other",
        ),
    ],
)
@pytest.mark.slow
def test_a_wrong_option_is_refused_before_anything_starts(
    words: tuple[object, ...], sentence: str, command: Callable[..., Any], tmp_path: Path
) -> None:
    done = command("run", "--case", 4, *words, cwd=tmp_path)
    assert done.returncode == 2
    assert sentence in done.stderr
    assert done.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())
