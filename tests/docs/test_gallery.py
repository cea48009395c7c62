"""Every example of the gallery runs as it stands, stays short, and draws a real picture."""

import ast
import contextlib
import io
import json
import os
import re
import runpy
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import matplotlib.pyplot as plt
import numpy as np
import pytest
from in_process import winding

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "examples" / "gallery"
EXAMPLES = sorted(FOLDER.glob("*.py"))
FEWER_LINES_THAN = 15
PATIENCE = 240.0
# Of matplotlib's first curves, blue-green-red.
CURVES = ((180, 119, 31), (14, 127, 255), (44, 160, 44))
# The last frame of a film of 5.5 s shows P1, which has just come to lie on the cylinder.
FILM = ("render", "film", "--case", 8, "--fps", 50, "--duration-s", 5.5)


def lines_of_code(text: str) -> int:
    docstring = ast.parse(text).body[0]
    printed = range(docstring.lineno, (docstring.end_lineno or 0) + 1)
    lines = enumerate(text.splitlines(), start=1)
    return sum(bool(line.strip()) and number not in printed for number, line in lines)


def run(example: str, *arguments: object, folder: Path) -> str:
    """Run an example in a folder, in this process, and return what it prints."""
    plt.switch_backend("agg")
    printed, words = io.StringIO(), [f"{example}.py", *map(str, arguments)]
    with (
        contextlib.chdir(folder),
        contextlib.redirect_stdout(printed),
        pytest.MonkeyPatch.context() as patch,
    ):
        patch.setattr(sys, "argv", words)
        runpy.run_path(str(FOLDER / f"{example}.py"), run_name="__main__")
    plt.close("all")
    return printed.getvalue()


def wound(*words: object, folder: Path) -> None:
    winding(folder, *words, code=0)


def picture(path: Path) -> np.ndarray:
    """Return a picture in which something is drawn."""
    pixels = cv2.imread(str(path))
    assert pixels is not None, f"{path.name} is no picture"
    assert min(pixels.shape[:2]) >= 150
    drawn = (pixels != pixels[0, 0]).any(axis=2)
    # A curve with its axes covers one pixel in a hundred, from edge to edge.
    assert drawn.mean() > 0.01
    rows, columns = np.nonzero(drawn)
    assert np.ptp(rows) > 0.5 * pixels.shape[0]
    assert np.ptp(columns) > 0.5 * pixels.shape[1]
    return pixels


def right_end(pixels: np.ndarray, colour: tuple[int, int, int]) -> float:
    """Return the mean row at which the curve of a colour ends on the right [px]."""
    rows, columns = np.nonzero((abs(pixels - colour) < 12).all(axis=2))
    assert columns.max() > 0.5 * pixels.shape[1]
    return float(rows[columns == columns.max()].mean())


def lengths(text: str) -> dict[int, float]:
    """Return the last length of each marker in a text [mm]."""
    return {int(n): float(s) for n, s in re.findall(r"P(\d) (?:lies )?(\d+\.\d+) mm", text)}


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_short(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert ast.get_docstring(ast.parse(text))
    assert lines_of_code(text) < FEWER_LINES_THAN


@pytest.mark.slow
def test_the_predicted_lay_is_that_of_the_command(tmp_path: Path) -> None:
    printed = lengths(run("predict_lay", folder=tmp_path))
    picture(tmp_path / "predict_lay.png")
    wound(
        "predict", "--cylinder-diameter-mm", 40, "--cable-diameter-mm", 3, "--tension-n", 2,
        "--marker-spacing-mm", 120, "--json", "prediction.json",
        folder=tmp_path,
    )  # fmt: skip
    record = json.loads((tmp_path / "prediction.json").read_text(encoding="utf-8"))
    # A tenth of a millimetre is printed.
    assert printed == {m["id"]: pytest.approx(1e3 * m["s_m"], abs=0.051) for m in record["markers"]}


@pytest.mark.slow
def test_a_heavier_weight_and_a_softer_cable_are_drawn_further(tmp_path: Path) -> None:
    run("sweep_weight", folder=tmp_path)
    pixels = picture(tmp_path / "sweep_weight.png").astype(int)
    softest, middle, stiffest = (right_end(pixels, colour) for colour in CURVES)
    assert softest < middle < stiffest


@pytest.mark.slow
def test_a_cable_whose_stress_fades_is_strained_further(tmp_path: Path) -> None:
    run("own_laws", folder=tmp_path)
    pixels = picture(tmp_path / "own_laws.png").astype(int)
    elastic, fading, _ = CURVES
    assert right_end(pixels, fading) < right_end(pixels, elastic)


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("gallery")
    wound(*FILM, folder=folder)
    return folder


def as_video(folder: Path) -> str:
    pictures = [cv2.imread(str(path)) for path in sorted((folder / "film").glob("*.png"))]
    rows, columns = pictures[0].shape[:2]
    code = cv2.VideoWriter.fourcc(*"mp4v")
    video = cv2.VideoWriter(str(folder / "film.mp4"), code, 50.0, (columns, rows))
    for frame in pictures:
        video.write(frame)
    video.release()
    return "film.mp4"


@pytest.mark.slow
@pytest.mark.parametrize("source", [lambda _: "film", as_video], ids=["folder", "video"])
def test_a_film_is_tracked_to_its_ground_truth(film: Path, source: Callable[[Path], str]) -> None:
    printed = run("track_film", source(film), folder=film)
    theta, x, y, z = map(
        float,
        re.search(r"P1: ([\d.]+) .* at \((.*), (.*), (.*)\)", printed).groups(),  # type: ignore[union-attr]
    )
    *_, last = (
        line.split(",")
        for line in (film / "film" / "truth.csv").read_text(encoding="utf-8").splitlines()
        if line.split(",")[1] == "1"
    )
    # Half a millimetre on a cylinder of 30 mm radius.
    assert theta == pytest.approx(float(last[2]), abs=0.02)
    assert z == pytest.approx(float(last[3]), abs=0.5e-3)
    assert np.hypot(x, y) == pytest.approx(31e-3, abs=1e-4)
    pixels = picture(film / "track_film.png").astype(int)
    blue, green, red = np.moveaxis(pixels, 2, 0)
    ring = (red > 200) & (green < 60) & (blue < 60)
    assert ring.sum() > 20
    rows, columns = (np.nonzero(ring)[k] for k in (0, 1))
    inside = pixels[rows.min() : rows.max(), columns.min() : columns.max()].reshape(-1, 3)
    # The yellow band stands inside the ring.
    assert ((inside[:, 1] - inside[:, 0] > 60) & (inside[:, 1] > 100)).sum() > 20


@pytest.mark.processes
@pytest.mark.slow
def test_a_recording_is_read_as_the_run_reported_it(recorded_run: Any, tmp_path: Path) -> None:
    printed = run("read_bag", recorded_run.bag, folder=tmp_path)
    picture(tmp_path / "read_bag.png")
    (marker, *_) = json.loads(recorded_run.json.read_text(encoding="utf-8"))["markers"]
    for topic, key in (
        ("fem/markers", "s_fem_m"),
        ("correction/markers", "s_corrected_m"),
        ("tracker/markers", "s_tracked_m"),
    ):
        (line,) = (line for line in printed.splitlines() if line.startswith(topic))
        assert lengths(line)[1] == pytest.approx(1e3 * marker[key], abs=0.06), topic


@pytest.mark.processes
@pytest.mark.slow
def test_a_node_of_ones_own_hears_the_corrected_lengths(command: Any, tmp_path: Path) -> None:
    listener = subprocess.Popen(
        [sys.executable, str(FOLDER / "listen.py")],
        cwd=tmp_path,
        env=os.environ,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        command(
            "run", "--case", 4, "--speed", 0, "--duration-s", 5.0, "--json", "run.json",
            cwd=tmp_path, code=0,
        )  # fmt: skip
        listener.send_signal(signal.SIGINT)
        printed, complaints = listener.communicate(timeout=PATIENCE)
    finally:
        listener.kill()
    assert listener.returncode == 0, complaints
    assert complaints == ""
    (marker, *_) = json.loads((tmp_path / "run.json").read_text(encoding="utf-8"))["markers"]
    assert lengths(printed)[1] == pytest.approx(1e3 * marker["s_corrected_m"], abs=0.06)
