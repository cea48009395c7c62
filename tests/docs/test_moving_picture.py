"""The moving picture of the README, and the program that makes it."""

import itertools
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chromium import CHROMIUM
from PIL import Image

from processes import ran

ROOT = Path(__file__).parents[2]
PROGRAM = ROOT / "docs" / "images" / "moving_picture.py"
SHOWN = ROOT / "docs" / "images" / "run-case-4.webp"

LARGEST = 2_000_000  # Of a forge


def make(*arguments: object, folder: Path) -> Image.Image:
    finished = ran(sys.executable, PROGRAM, *arguments, cwd=folder, timeout=240.0)
    assert finished.returncode == 0, finished.stderr
    return Image.open(folder / "made.webp")


def frames(picture: Image.Image) -> list[tuple[np.ndarray, float]]:
    """Return the frames of a moving picture, and how long each is shown [s]."""
    found = []
    for number in range(picture.n_frames):  # type: ignore[attr-defined]
        picture.seek(number)
        picture.load()
        pixels = np.asarray(picture.convert("RGB")).astype(int)
        found.append((pixels, picture.info["duration"] / 1e3))
    return found


@pytest.mark.slow
def test_the_readme_begins_with_a_loop() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert readme.index("(docs/images/run-case-4.webp)") < readme.index("\n## ")
    assert SHOWN.stat().st_size <= LARGEST
    picture = Image.open(SHOWN)
    assert picture.info["loop"] == 0
    assert len(frames(picture)) > 10


@pytest.mark.campaign
@pytest.mark.processes
def test_a_recording_becomes_a_moving_picture(recorded_run: Any, tmp_path: Path) -> None:
    found = frames(make("run", recorded_run.bag, "made.webp", folder=tmp_path))
    # One every tenth of a second, both ends included; equal ones would be one.
    assert len(found) == 10 * recorded_run.duration + 1
    pictures = [pixels for pixels, _ in found]
    assert all((a != b).any() for a, b in itertools.pairwise(pictures))
    boxed = [bool((abs(p - (93, 255, 143)) < 40).all(axis=2).sum() > 50) for p in pictures]
    # P0 leaves the window within 0.7 s; a turn later it comes back with P1.
    assert any(boxed[:10])
    assert not any(boxed[10:35])
    assert any(boxed[35:])


@pytest.mark.campaign
@pytest.mark.skipif(not CHROMIUM.exists(), reason="needs Chromium")
def test_a_page_becomes_a_moving_picture(tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    page.write_text(
        "<body style='margin:0'><div id='band'><b class='word'>WINDING</b></div>"
        "<script>let n = 0; setInterval(() => document.body.style.background"
        " = `hsl(${n += 40} 100% 50%)`, 50)</script>",
        encoding="utf-8",
    )
    made = make("page", page.as_uri(), "made.webp", "--seconds", 1, folder=tmp_path)
    assert made.size == (960, 600)
    assert len(frames(made)) > 1
