"""Pictures of the page: axes, curves, and the cylinder from where one looks."""

import math
import re

import numpy as np
import pytest
from controlled_page import note_run
from simulated_page import fresh_state

from winding_core.lay.records import ControlMode
from winding_core.markers import CABLE_DTYPE
from winding_dashboard.drawings.cable_shape import cable_shape
from winding_dashboard.drawings.cylinder_view import SIZE, Sight, cylinder_drawing
from winding_dashboard.drawings.line_chart import Band, Curve, Ends, chart, ends_of
from winding_dashboard.drawings.palette import DRUM, GROUND, MEASURED, tension_colours
from winding_dashboard.drawings.run_charts import SPEEDS
from winding_dashboard.state.trace import Trace

X, Y = Ends(0.0, 10.0, 5.0), Ends(0.0, 100.0, 50.0)


def path(drawing: str, kind: str) -> str:
    found = re.search(rf'class="{kind}[^"]*" d="([^"]*)"', drawing)
    assert found is not None
    return found.group(1)


def test_ends_of_the_axes_are_the_corners_of_a_curve() -> None:
    drawn = chart([Curve(points=[[0.0, 0.0], [10.0, 100.0]], style="a")], X, Y, size=(320.0, 150.0))
    (left, bottom), (right, top) = [
        tuple(map(float, point.split())) for point in path(drawn, "curve")[1:].split("L")
    ]
    assert left < right <= 320.0
    assert 0.0 <= top < bottom < 150.0


def test_missing_value_is_a_gap_and_no_value_is_no_curve() -> None:
    points = [[0.0, 1.0], [1.0, 2.0], [2.0, None], [3.0, 4.0], [4.0, 5.0]]
    assert path(chart([Curve(points=points, style="a")], X, Y), "curve").count("M") == 2
    assert "curve" not in chart([Curve(points=[[0.0, None]], style="a")], X, Y)


def test_last_point_of_a_thinned_curve_is_its_newest() -> None:
    points = [[0.01 * i, 10.0] for i in range(999)]
    drawn = path(chart([Curve(points=points, style="a")], X, Y), "curve")
    assert drawn.count("L") <= 201
    whole = chart([Curve(points=[points[0], points[-1]], style="a")], X, Y)
    assert drawn.split("L")[-1] == path(whole, "curve").split("L")[-1]


def test_band_lies_between_its_ends() -> None:
    drawn = chart([], X, Y, bands=[Band(x=(5.0, 10.0), y=(0.0, 50.0))])
    height = re.search(r'height="([\d.]+)"', drawn)
    assert height is not None
    assert float(height.group(1)) == pytest.approx(0.5 * (150.0 - 8.0 - 20.0))


def test_axis_of_nothing_is_an_axis() -> None:
    assert ends_of([], 0.2).high > 0.0
    for live in SPEEDS:
        assert "nan" not in live.drawing(
            Trace("speed", "speed_set", "feed", "feed_set", "tension"), 0.0
        )


@pytest.mark.parametrize(("yaw", "pitch"), [(0.0, 0.0), (-14.0, 18.0), (60.0, -40.0)])
def test_sight_is_a_rotation(yaw: float, pitch: float) -> None:
    rows = Sight(yaw=math.radians(yaw), pitch=math.radians(pitch)).rows
    assert rows @ rows.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(rows) == pytest.approx(1.0)


def test_from_straight_ahead_one_sees_what_the_camera_sees() -> None:
    right, up, near = Sight(yaw=0.0, pitch=0.0).rows
    assert (right @ [0, 0, 1], up @ [0, -1, 0], near @ [1, 0, 0]) == (1.0, 1.0, 1.0)


def test_from_above_one_sees_the_top() -> None:
    assert Sight(yaw=0.0, pitch=math.radians(30.0)).rows[2] @ [0.0, -1.0, 0.0] > 0.0


def test_cylinder_hides_what_is_behind_it_and_everything_is_in_the_picture() -> None:
    state = fresh_state()
    note_run(state, 30.0, ControlMode.DRIVE)
    drawn = cylinder_drawing(state, Sight())
    drum = drawn.index("<polygon")
    assert "<polyline" in drawn[:drum]
    assert "<polyline" in drawn[drum:]
    assert drawn.rindex("<circle") > drawn.rindex("<polyline")
    for line in re.findall(r'<polyline points="([^"]*)"', drawn):
        for point in line.split():
            u, v = map(float, point.split(","))
            assert 0.0 <= u <= SIZE[0]
            assert 0.0 <= v <= SIZE[1]


def test_nothing_known_is_nothing_drawn() -> None:
    assert cylinder_drawing(fresh_state(), Sight()) == ""


def test_cable_is_drawn_evenly_with_its_tension() -> None:
    cable = np.zeros(3, CABLE_DTYPE)
    cable["z"] = [0.0, 0.01, 0.05]
    cable["tension"] = [1.0, 1.0, 3.0]
    shape = cable_shape(cable, count=11)
    assert shape is not None
    steps = np.linalg.norm(np.diff(shape.points, axis=0), axis=1)
    # Positions are single precision: 1e-7 of the cable's length.
    assert steps == pytest.approx(np.full(10, 0.005), rel=1e-5)
    assert (shape.low, shape.high) == (1.0, 3.0)
    assert (np.diff(shape.share)[2:] > 0.0).all()


@pytest.mark.parametrize("count", [0, 1])
def test_less_than_two_nodes_are_no_cable(count: int) -> None:
    assert cable_shape(np.zeros(count, CABLE_DTYPE)) is None


def luminance(colour: str) -> float:
    """Return the relative luminance of WCAG 2."""
    shares = np.array(list(bytes.fromhex(colour[1:]))) / 255.0
    linear = np.where(shares <= 0.04045, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def contrast(one: str, other: str) -> float:
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def test_cable_and_markers_stand_out_from_the_cylinder_and_from_the_ground() -> None:
    colours = tension_colours(np.linspace(0.0, 1.0, 21))
    lightness = [luminance(colour) for colour in colours]
    assert sorted(lightness) == lightness
    # WCAG 2.1, 1.4.11: graphics need 3 : 1.
    for colour in (*colours, MEASURED):
        assert contrast(colour, DRUM) >= 3.0
        assert contrast(colour, GROUND) >= 3.0
