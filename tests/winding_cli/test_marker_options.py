"""How markers look is an option of the commands that film and track."""

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from winding_cli.commands.run import run
from winding_cli.commands.track import track
from winding_core.marker_parameters import MarkerLook
from winding_core.options import options
from winding_core.parameters import declarations
from winding_ros import graph


@pytest.mark.parametrize("node", [graph.RIG, graph.TRACKER])
def test_camera_and_tracker_have_every_parameter(node: str) -> None:
    wanted = {item.name for item in declarations(MarkerLook)}
    assert {item.name for item in declarations(graph.parameters_of(node))} >= wanted


@pytest.mark.parametrize("command", [run, track], ids=lambda command: command.__name__)
def test_both_commands_take_every_option(command: Callable[..., None]) -> None:
    keys = set(options(MarkerLook))
    assert keys == {"marker_kind", "band_mm", "dot_mm", "marker_colours"}
    assert set(inspect.signature(command).parameters) >= keys


def test_a_colour_that_is_none_is_refused_before_anything_starts(
    command: Callable[..., Any], tmp_path: Path
) -> None:
    done = command("run", "--case", 4, "--marker-colours", "pink", cwd=tmp_path)
    assert done.returncode == 2
    assert "marker_colours must list red" in done.stderr
    assert done.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())
