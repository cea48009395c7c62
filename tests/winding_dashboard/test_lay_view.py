"""The measured lay on the page: over the picture, and against the commanded helix."""

import math
import re

import numpy as np
import pytest

from winding_core.lay.records import LAY_DTYPE, LayFlag, LayRecords
from winding_core.machine.readings import AxisReading, ImageWindow
from winding_dashboard.drawings.lay_chart import defects_told, lay_errors
from winding_dashboard.drawings.lay_overlay import lay_overlay
from winding_dashboard.state.camera_view import CameraView
from winding_dashboard.state.view_state import ViewState

ADVANCE, RADIUS = 2.9e-3, 0.017
VIEW = CameraView(
    matrix=np.array([[5000.0, 0.0, 960.0], [0.0, 5000.0, 540.0], [0.0, 0.0, 1.0]]),
    distortion=np.zeros(5),
    window=ImageWindow(),
    width=1920,
    height=1080,
    position=np.array([0.4175, 0.0, 0.03]),
    tilt=np.zeros(3),
)


def lay(turns: float = 3.0, angle: float = 20.0) -> LayRecords:
    """Return an even lay of some turns, every 5 degrees, on a cylinder turned by an angle."""
    theta = np.radians(np.arange(2.5, 360.0 * turns, 5.0))
    records = np.zeros(theta.size, LAY_DTYPE)
    records["theta"], records["turn"] = theta, theta // math.tau
    records["x"], records["y"] = RADIUS * np.cos(angle - theta), RADIUS * np.sin(angle - theta)
    records["z"] = ADVANCE * theta
    return records


def lines(svg: str) -> list[np.ndarray]:
    return [
        np.array([pair.split(",") for pair in points.split()], dtype=float)
        for points in re.findall(r'polyline points="([^"]+)"', svg)
    ]


def test_every_turn_on_the_camera_s_side_is_drawn_once_with_its_edge() -> None:
    drawn = lines(lay_overlay(lay(), VIEW))
    # Each line twice, dark below and bright above.
    assert len(drawn) == 2 * 3
    for line in drawn:
        # 0.4 m before 5000 px of focal length: 12.4 px/mm, a turn of 34 mm.
        assert 200.0 < np.ptp(line[:, 1]) < 430.0
        assert np.ptp(line[:, 0]) < 0.5 * math.tau * ADVANCE * 12.9e3


def test_a_turned_cylinder_carries_its_lay_along() -> None:
    later = lay_overlay(lay(), VIEW, turned=0.1)
    assert later == lay_overlay(lay(angle=20.1), VIEW)


def test_what_lies_wrongly_is_ringed_and_named() -> None:
    records = lay()
    wrong = np.abs(records["theta"] - 8.0) < 0.2
    records["flags"][wrong] = LayFlag.GAP
    assert defects_told(records) == "gap on turn 2"
    facing = np.cos(20.0 - records["theta"][wrong]) > 0.4
    assert lay_overlay(records, VIEW).count("<circle") == facing.sum()


def test_an_even_lay_has_no_error_and_a_shifted_one_its_shift() -> None:
    records = lay()
    records["z"][36:] += 0.7e-3
    errors = np.array(lay_errors(records, ADVANCE))
    # Single precision of z: a tenth of a micrometre.
    np.testing.assert_allclose(errors[:36, 1], 0.0, atol=1e-3)
    np.testing.assert_allclose(errors[36:, 1], 0.7, atol=1e-3)
    assert errors[-1, 0] == pytest.approx(3.0, abs=0.01)


def test_nothing_is_drawn_before_anything_was_measured() -> None:
    assert lay_overlay(np.zeros(0, LAY_DTYPE), VIEW) == ""


def test_the_commanded_advance_is_kept_while_the_machine_stands() -> None:
    state = ViewState(nodes=["winding_rig"], machine="winding_rig", solver="cable_fem")
    for t, speed in ((1.0, 2.0), (2.0, 0.0)):
        moving = AxisReading(
            cylinder_angle=t, angular_speed=speed, carriage_position=0.0, feed_speed=5e-3 * speed
        )
        state.note_axes(t, moving)
        state.setpoints = moving
        state.tick(t)
    assert state.advance == pytest.approx(5e-3)
