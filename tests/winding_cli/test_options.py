"""Options: every parameter is one, help lists every command, and a wrong value is refused."""

import dataclasses
import inspect
import random
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import typer
from in_process import winding

from winding_cli.app import COMMANDS, app, summary
from winding_cli.commands.camera import render
from winding_cli.commands.identify import identify
from winding_cli.commands.plan import plan
from winding_cli.commands.predict import predict
from winding_cli.commands.run import run
from winding_cli.commands.track import track
from winding_core.cable.condition import Condition
from winding_core.markers import MarkerLook
from winding_core.parameters import declarations, option_kinds, options
from winding_core.run_options import CameraClockParameters, SolverOptions
from winding_dashboard.page.condition_form import FIELDS, LAWS
from winding_ros.graph import FEM, GRAPH, RIG, TRACKER, parameters_of
from winding_study.run_parameters import RunParameters

NAMES = {item.name for item in dataclasses.fields(Condition)}
KEYS = set(options(Condition))
# Record -> nodes that have its parameters, commands that have its options.
TAKEN = {
    Condition: (GRAPH, (predict, plan, run, track, identify)),
    SolverOptions: ((FEM,), (predict, plan, run)),
    MarkerLook: ((RIG, TRACKER), (run, track, render)),
    CameraClockParameters: ((TRACKER,), (run, track)),
}
# What a command needs beside the option under test, so that nothing else is wrong with it.
BESIDE = {
    "run": ["--case", "4"],
    "predict": ["--case", "4"],
    "plan": ["--case", "4", "--even"],
    "commission": ["--case", "4"],
    "render": ["pictures"],
    "board": ["board.png"],
    "sweep": ["spec.yaml"],
}
# They need recordings or a running graph before any option is looked at, or take any text for one.
LEFT_OUT = {
    *("track", "identify", "calibrate", "bag", "conform", "health", "play-film", "check-film")
}
NUMBERS = ("abc", "-1e9", "nan")
PLACES = ("/dev/null/x", "/proc/nothere/x")


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
        (("--camera-clock-limit-ms", 5000),
         "--camera-clock-limit-ms must be at most 2000, got 5000"),
        (("--marker-colours", "pink"), "marker_colours must list red"),
        (("--row-time-us", 5), "--row-time-us is for the pictures of a real camera"),
        (("--image-transport", "compressed"), "--image-transport is for the pictures of a real"),
        (("--machine", "external", "--no-camera", "--measure-lay", "--encoding", "rgb8"),
         "--encoding and --measure-lay need a camera"),
        (("--lay-tolerance-mm", 0.2), "--lay-tolerance-mm judges a wanted lay"),
        (("--control", "drive", "--lay-tolerance-mm", 0), "--lay-tolerance-mm must be positive"),
        (("--compose", "my_camera:open"), "the simulated machine has a camera of its own"),
        (("--compose", "camera", "--attach"), "compose its camera there"),
        (("--compose", "camera", "--secure"), "--compose and --secure exclude each other"),
        (("--frame-rate", 300), "--frame-rate must be 200 or 1000, got 300"),
        (("--machine", "external", "--compose", "nowhere.py:open"), "no camera at nowhere.py"),
        (("--machine", "external", "--no-camera", "--compose", "json:load"),
         "--compose needs a camera"),
    ],
)  # fmt: skip
@pytest.mark.slow
def test_a_wrong_option_is_refused_before_anything_starts(
    words: tuple[object, ...], sentence: str, command: Callable[..., Any], tmp_path: Path
) -> None:
    done = command("run", "--case", 4, *words, cwd=tmp_path, code=2)
    assert sentence in done.stderr
    assert done.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_help_lists_every_command_with_the_first_paragraph_of_its_own_help() -> None:
    commands: Any = typer.main.get_command(app)
    own = {
        name: " ".join(command.help.split("\n\n")[0].split())
        for name, command in commands.commands.items()
        if name in COMMANDS
    }
    assert {name: summary(name) for name in COMMANDS} == own


@pytest.mark.slow
def test_a_film_shows_the_markers_that_were_asked_for(tmp_path: Path) -> None:
    looks = {
        "bands": (),
        "dots": ("--marker-kind", "dot", "--dot-mm", 3),
        "red": ("--marker-colours", "red,yellow"),
    }
    pictures = {}
    for name, look in looks.items():
        film = ("render", name, "--fps", 1, "--duration-s", 1, "--noise", 0)
        winding(tmp_path, *film, *look, code=0)
        (file,) = (tmp_path / name).rglob("*.png")
        pictures[name] = cv2.imread(str(file)).astype(int)
    # P0 alone is in sight as the run begins: yellow has green, red has none.
    yellow = (pictures["bands"][..., 1] > 2 * pictures["bands"][..., 0]).sum()
    dots = (pictures["dots"][..., 1] > 2 * pictures["dots"][..., 0]).sum()
    red = pictures["red"]
    assert 0 < dots < yellow
    assert (red[..., 2] > 2 * np.maximum(red[..., 0], red[..., 1])).sum() > 0.5 * yellow


def wrong_inputs() -> Iterator[tuple[str, str, str]]:
    """Yield command, option and a value that is wrong for any option of its type."""
    root: Any = typer.main.get_command(app)
    for name, command in root.commands.items():
        if name in LEFT_OUT:
            continue
        for item in command.params:
            if item.param_type_name != "option" or item.is_flag:
                continue
            kind = item.type_descriptor.annotation
            values = NUMBERS if kind in (int, float) else PLACES if kind is Path else ()
            for value in values:
                yield name, item.opts[0], value


INPUTS = sorted(wrong_inputs())


def chosen(count: int, seed: int) -> list[tuple[str, str, str]]:
    return random.Random(seed).sample(INPUTS, count)


def words_of(folder: Path, name: str, option: str, value: str) -> list[str]:
    """Return the words of a command with a wrong value, and write the file that it may need."""
    (folder / "spec.yaml").write_text("parameters: {case: [4]}\n", encoding="utf-8")
    words = list(BESIDE.get(name, []))
    if option in words:
        at = words.index(option)
        del words[at : at + 2]
    return [name, *words, f"{option}={value}"]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "option", "value"), chosen(20, 1))
def test_wrong_value_is_refused_by_name(tmp_path: Path, name: str, option: str, value: str) -> None:
    done = winding(tmp_path, *words_of(tmp_path, name, option, value), code=2)
    assert "Traceback" not in done.output
    assert option in done.output


@pytest.mark.campaign
@pytest.mark.timeout(3000)
def test_a_hundred_wrong_values_are_refused_by_name(tmp_path: Path, command: Any) -> None:
    for n, (name, option, value) in enumerate(chosen(100, 2)):
        words = words_of(tmp_path, name, option, value)
        if n < 10:
            ended = command(*words, cwd=tmp_path)
            code, said = ended.returncode, ended.stderr
        else:
            # A process of its own adds a second, and its start is that of the others.
            result = winding(tmp_path, *words)
            code, said = result.exit_code, result.output
        assert code == 2, said
        assert "Traceback" not in said
        assert option in said
