"""How markers look is an option of the commands that film and track."""

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from winding_cli.commands.render import render
from winding_cli.commands.run import run
from winding_cli.commands.track import track
from winding_core.markers import MarkerLook
from winding_core.parameters import declarations, options
from winding_ros import graph


@pytest.mark.parametrize("node", [graph.RIG, graph.TRACKER])
def test_camera_and_tracker_have_every_parameter(node: str) -> None:
    wanted = {item.name for item in declarations(MarkerLook)}
    assert {item.name for item in declarations(graph.parameters_of(node))} >= wanted


@pytest.mark.parametrize("command", [run, track, render], ids=lambda command: command.__name__)
def test_commands_take_every_option(command: Callable[..., None]) -> None:
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


def test_a_film_shows_the_markers_that_were_asked_for(
    command: Callable[..., Any], tmp_path: Path
) -> None:
    looks = {
        "bands": (),
        "dots": ("--marker-kind", "dot", "--dot-mm", 3),
        "red": ("--marker-colours", "red,yellow"),
    }
    pictures = {}
    for name, look in looks.items():
        film = ("render", name, "--fps", 1, "--duration-s", 1, "--noise", 0)
        assert command(*film, *look, cwd=tmp_path).returncode == 0
        (file,) = (tmp_path / name).rglob("*.png")
        pictures[name] = cv2.imread(str(file)).astype(int)
    # P0 alone is in sight as the run begins: yellow has green, red has none.
    yellow = (pictures["bands"][..., 1] > 2 * pictures["bands"][..., 0]).sum()
    dots = (pictures["dots"][..., 1] > 2 * pictures["dots"][..., 0]).sum()
    red = pictures["red"]
    assert 0 < dots < yellow
    assert (red[..., 2] > 2 * np.maximum(red[..., 0], red[..., 1])).sum() > 0.5 * yellow


def test_what_a_simulated_camera_cannot_be_told_is_refused(
    command: Callable[..., Any], tmp_path: Path
) -> None:
    done = command("run", "--case", 4, "--row-time-us", 5, cwd=tmp_path)
    assert done.returncode == 2
    assert "--row-time-us is for the pictures of a real camera" in done.stderr
    assert not list(tmp_path.iterdir())


def test_what_needs_a_camera_is_refused_without_one(
    command: Callable[..., Any], tmp_path: Path
) -> None:
    words = ("--machine", "external", "--no-camera", "--measure-lay", "--encoding", "rgb8")
    done = command("run", "--case", 4, *words, cwd=tmp_path)
    assert done.returncode == 2
    assert "--encoding and --measure-lay need a camera" in done.stderr
