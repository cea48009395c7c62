"""Pictures of the page: charts, cylinder, overlays on the camera's picture, colours."""

import math
import re
from collections import deque
from pathlib import Path

import cv2
import numpy as np
import pytest
from axis_readings import axis_reading
from controlled_page import note_run
from simulated_page import fresh_state, wound

import winding_dashboard
from winding_core.cable.condition import Condition
from winding_core.lay.records import LAY_DTYPE, ControlMode, LayFlag, LayRecords
from winding_core.machine.drum import Drum
from winding_core.machine.readings import ImageWindow
from winding_core.markers import CABLE_DTYPE, MarkerFlag, Markers, wound_markers
from winding_dashboard.drawings.camera_overlay import band_overlay, lay_overlay, measured_count
from winding_dashboard.drawings.cylinder_view import SIZE, Sight, cable_shape, cylinder_drawing
from winding_dashboard.drawings.lay_charts import defect_sentence, helix_errors
from winding_dashboard.drawings.line_chart import Band, Curve, Ends, chart, ends_of
from winding_dashboard.drawings.palette import DRUM, GROUND, MEASURED, tension_colours
from winding_dashboard.drawings.run_charts import SPEEDS
from winding_dashboard.state.camera_view import CameraView
from winding_dashboard.state.view_state import ViewState

MATRIX = np.array([[5000.0, 0.0, 960.0], [0.0, 5000.0, 540.0], [0.0, 0.0, 1.0]])
DISTORTION = np.array([-0.12, 0.05, 0.001, -0.0007, 0.02])
POSITION = np.array([0.4175, 0.0, 0.05])
WINDOW = ImageWindow(x_offset=0, y_offset=393, width=1920, height=288, binning=3)
ADVANCE, RADIUS = 2.9e-3, 0.017
X, Y = Ends(0.0, 10.0, 5.0), Ends(0.0, 100.0, 50.0)
STYLE = (Path(winding_dashboard.__file__).parent / "data" / "page.css").read_text(encoding="utf-8")
TEXT = ("ink", "soft", "predicted", "corrected", "measured", "danger", "warn", "good")
GRAPHICS = ("edge", "focus", "predicted", "corrected", "measured")
FILLED = ("danger", "go", "ink")


def camera(tilt: tuple[float, float, float] = (0.0, 0.0, 0.0), **changes: object) -> CameraView:
    values: dict[str, object] = {
        "matrix": MATRIX,
        "distortion": DISTORTION,
        "window": WINDOW,
        "width": 1920,
        "height": 1080,
        "position": POSITION,
        "tilt": np.array(tilt),
    }
    return CameraView(**{**values, **changes})


VIEW = camera(
    distortion=np.zeros(5),
    window=ImageWindow(),
    height=1080,
    position=np.array([0.4175, 0.0, 0.03]),
)


@pytest.mark.parametrize("tilt", [(0.0, 0.0, 0.0), (0.03, -0.05, 0.02)])
def test_full_sensor_agrees_with_opencv(tilt: tuple[float, float, float]) -> None:
    view = camera(tilt, window=ImageWindow())
    points = np.random.default_rng(3).uniform([-0.02, -0.02, 0.0], [0.02, 0.02, 0.1], (50, 3))
    nominal = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    rotation = cv2.Rodrigues(np.array(tilt))[0].T @ nominal
    expected, _ = cv2.projectPoints(
        points, cv2.Rodrigues(rotation)[0], -rotation @ POSITION, MATRIX, DISTORTION
    )
    # Both are double precision; a thousandth of a pixel is far below what a screen shows.
    np.testing.assert_allclose(view.pixels(points), expected.reshape(-1, 2), atol=1e-3)


def test_window_and_binning_follow_rep_104() -> None:
    point = np.array([[0.017, 0.0, 0.05]])
    ((column, row),) = camera(window=ImageWindow()).pixels(point)
    ((u, v),) = camera().pixels(point)
    assert u == pytest.approx((column + 0.5) / 3 - 0.5)
    assert v == pytest.approx((row - 393 + 0.5) / 3 - 0.5)
    assert camera().size == (640, 96)


def marked(angle: float, *flags: int) -> Markers:
    ids = np.arange(len(flags))
    at = {"radius": 0.017, "cylinder_angle": angle, "flags": np.array(flags)}
    return wound_markers(ids=ids, theta=0.0 * ids, z=0.02 + 0.03 * ids, **at)


def overlay(angle: float, *flags: int, turned: float = 0.0) -> str:
    return band_overlay(marked(angle, *flags), camera(), cable_radius=0.002, turned=turned)


def test_every_band_that_faces_the_camera_is_framed_and_named() -> None:
    drawn = overlay(0.0, 0, 0)
    assert re.findall(r">(P\d)<", drawn) == ["P0", "P1"]
    assert drawn.count("<polygon") == 4


def test_bands_behind_the_cylinder_are_not_drawn() -> None:
    assert overlay(np.pi, 0, 0) == ""


def test_band_that_was_not_measured_is_dashed() -> None:
    assert "dasharray" not in overlay(0.0, MarkerFlag.TOUCHING)
    assert "dasharray" in overlay(0.0, MarkerFlag.PREDICTED)


def test_marker_that_is_not_wound_is_not_drawn() -> None:
    assert overlay(0.0, MarkerFlag.NOT_WOUND) == ""


def test_frame_moves_with_the_cylinder() -> None:
    assert overlay(0.1, 0) == overlay(0.0, 0, turned=0.1)


def test_only_what_this_frame_shows_counts_as_measured() -> None:
    unseen = (MarkerFlag.PREDICTED, MarkerFlag.OCCLUDED, MarkerFlag.NOT_WOUND)
    assert measured_count(marked(0.0, 0, MarkerFlag.TOUCHING, *unseen)) == 2


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
    assert defect_sentence(records) == "gap on turn 2"
    facing = np.cos(20.0 - records["theta"][wrong]) > 0.4
    assert lay_overlay(records, VIEW).count("<circle") == facing.sum()


def test_an_even_lay_has_no_error_and_a_shifted_one_its_shift() -> None:
    records = lay()
    records["z"][36:] += 0.7e-3
    errors = np.array(helix_errors(records, ADVANCE))
    # Single precision of z: a tenth of a micrometre.
    np.testing.assert_allclose(errors[:36, 1], 0.0, atol=1e-3)
    np.testing.assert_allclose(errors[36:, 1], 0.7, atol=1e-3)
    assert errors[-1, 0] == pytest.approx(3.0, abs=0.01)


def test_nothing_is_drawn_before_anything_was_measured() -> None:
    assert lay_overlay(np.zeros(0, LAY_DTYPE), VIEW) == ""


def test_the_commanded_advance_is_kept_while_the_machine_stands() -> None:
    state = ViewState(nodes=["winding_rig"], machine="winding_rig", solver="cable_fem")
    for t, speed in ((1.0, 2.0), (2.0, 0.0)):
        moving = axis_reading(t, speed=speed, feed=5e-3 * speed)
        state.note_axes(t, moving)
        state.setpoints = moving
        state.tick(t)
    assert state.advance == pytest.approx(5e-3)


def path(drawing: str, kind: str) -> str:
    found = re.search(rf'class="{kind}[^"]*" d="([^"]*)"', drawing)
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
    assert float(height.group(1)) == pytest.approx(0.5 * (150.0 - 8.0 - 20.0))


def test_axis_of_nothing_is_an_axis() -> None:
    assert ends_of([], 0.2).high > 0.0
    for live in SPEEDS:
        assert "nan" not in live.drawing(deque(), 0.0)


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


def test_flanges_stand_at_both_ends_of_what_is_wound_between_them() -> None:
    state, drum = fresh_state(), Drum(radius=0.015, width=0.13, flange_height=0.02)
    note_run(state, 30.0, ControlMode.DRIVE)
    wound(state, Condition(case=4), drum)
    drawn = cylinder_drawing(state, Sight(yaw=0.0, pitch=0.0))
    rims = re.findall(r'<ellipse cx="([\d.]+)" cy="[\d.]+" rx="[\d.]+" ry="([\d.]+)"', drawn)
    places, heights = np.array(rims, dtype=float).T
    high, inner = heights.max(), heights.min()
    # Coordinates have a decimal; the width is 8.7 radii.
    assert high / inner == pytest.approx(drum.flange_radius / drum.radius, rel=3e-3)
    scale = inner / drum.radius
    assert np.ptp(places[heights == high]) == pytest.approx(drum.width * scale, abs=0.6)
    assert drawn.index("<ellipse") < drawn.index("<polyline") < drawn.rindex("<ellipse")


def test_nothing_known_is_nothing_drawn() -> None:
    assert cylinder_drawing(fresh_state(), Sight()) == ""


def test_cable_is_drawn_evenly_with_its_tension() -> None:
    cable = np.zeros(3, CABLE_DTYPE)
    cable["z"] = [0.0, 0.01, 0.05]
    cable["tension"] = [1.0, 1.0, 3.0]
    shape = cable_shape(cable, count=11)
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


def theme(name: str) -> dict[str, str]:
    blocks = re.findall(r":root \{(.*?)\}", STYLE, flags=re.DOTALL)
    light, dark = (dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6})", block)) for block in blocks)
    return {"light": light, "dark": {**light, **dark}}[name]


@pytest.mark.parametrize("name", ["light", "dark"])
@pytest.mark.parametrize("ground", ["paper", "tint"])
def test_text_has_four_and_a_half_and_graphics_have_three(name: str, ground: str) -> None:
    colours = theme(name)
    for text in TEXT:
        assert contrast(colours[text], colours[ground]) >= 4.5, text
    for graphic in GRAPHICS:
        assert contrast(colours[graphic], colours[ground]) >= 3.0, graphic


@pytest.mark.parametrize("name", ["light", "dark"])
def test_words_on_filled_buttons_can_be_read(name: str) -> None:
    colours = theme(name)
    for ground in ("danger", "go"):
        assert contrast(colours["on"], colours[ground]) >= 4.5, ground
    assert contrast(colours["paper"], colours["ink"]) >= 4.5


@pytest.mark.parametrize("name", ["light", "dark"])
def test_band_of_tolerance_leaves_the_curves_readable(name: str) -> None:
    colours = theme(name)
    for curve in ("predicted", "measured"):
        assert contrast(colours[curve], colours["band"]) >= 3.0, curve


def test_scale_of_the_tension_has_the_colours_of_the_cable() -> None:
    (scale,) = re.findall(r"linear-gradient\(to right, ([^)]*)\)", STYLE)
    stops = scale.split(", ")
    assert stops == tension_colours(np.linspace(0.0, 1.0, len(stops)))
