"""A cell of the tests' own, with its own units, servo and lay law, is driven to the same limits."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sensor_cell import running

from lay_control_node.ros.parameters import LayControlParameters

pytestmark = [pytest.mark.campaign, pytest.mark.processes, pytest.mark.timeout(900)]

CELL = Path(__file__).with_name("commanded_cell.py")
ADVANCE = LayControlParameters().resolved().drive.advance_per_radian


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_markers_of_another_cell_land_on_the_wanted_helix(
    seed: int, tmp_path: Path, command: Callable[..., Any]
) -> None:
    truth = tmp_path / "truth.json"
    with running(CELL, seed, truth, namespace="cell"):
        done = command(
            *("run", "--case", 4, "--machine", "external", "--namespace", "cell"),
            *("--cylinder-joint", "spindle", "--carriage-joint", "slide"),
            *("--carriage-scale", -0.001, "--control", "drive", "--duration-s", 13),
            *("--output", tmp_path / "run"),
            cwd=tmp_path,
        )
    assert done.returncode == 0, done.stdout + done.stderr
    lay = json.loads(truth.read_text(encoding="utf-8"))
    theta, z = np.array(lay["theta"]), np.array(lay["z"])
    markers = np.array([angle for angle in lay["markers"] if angle < theta[-1]])
    assert markers.size >= 3
    error = np.abs(np.interp(markers, theta, z) - ADVANCE * markers)
    # The limits of the project's own hidden rigs: 1.0 mm at P1 and P2, 0.5 mm from P3 on.
    assert (error < np.array([1.0e-3, 1.0e-3, *[0.5e-3] * (markers.size - 2)])).all(), error
