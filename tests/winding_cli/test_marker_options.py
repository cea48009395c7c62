"""A film shows its markers as the options ask."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np


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
