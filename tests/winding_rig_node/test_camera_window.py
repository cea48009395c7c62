"""What the camera draws depends neither on what its window cannot show nor on earlier frames."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from winding_core.cable.cases import paper_case
from winding_rig_node.camera import (
    CablePath,
    CameraConfig,
    GrowingPath,
    Renderer,
    Scene,
    SensorNoise,
)
from winding_rig_node.camera.cable_path import path_crosses, path_height
from winding_rig_node.camera.config import Window
from winding_rig_node.camera.shown_lay import GrowingLay, SeenLay
from winding_rig_node.lay.driven_lay import DrivenLay
from winding_rig_node.lay.lay_on import HiddenRig

CONFIG = replace(CameraConfig(), noise=SensorNoise(read=0.0, shot=0.0))
PITCH = 2.87e-3  # dz per radian of the paper's drive
FAR = 5.0  # an axial position [m] that no window shows


def scene(path: CablePath, angle: float, markers: Sequence[float] = (), **changes: Any) -> Scene:
    made = Scene(
        cylinder_radius=0.015,
        cable_radius=0.002,
        cylinder_angle=angle,
        path=path,
        marker_theta=np.array(markers, dtype=float),
        guide_z=float(path.height(np.array(angle))),
        free_length=0.198,
    )
    return replace(made, **changes)


def helix(end: float) -> CablePath:
    theta = np.arange(0.0, end, 0.02)
    return CablePath(theta=theta, z=PITCH * theta)


def frame(made: Scene, renderer: Renderer | None = None) -> np.ndarray:
    return (renderer or Renderer(CONFIG)).render(made, np.random.default_rng(0))


def cable_pixels(picture: np.ndarray) -> np.ndarray:
    """Return the columns where a frame differs from that of a bare cylinder."""
    nowhere = CablePath(theta=np.array([0.0, 1.0]), z=np.array([FAR, FAR]))
    bare = frame(scene(nowhere, 0.0, guide_z=FAR))
    return (picture.astype(int) != bare).any(axis=(0, 2))


def test_after_many_turns_the_turns_out_of_the_window_make_no_difference() -> None:
    angle = 346.0
    long = helix(angle + 1.0)
    outside = (long.z > 0.16) | (long.z < -0.03)
    moved = CablePath(theta=long.theta, z=np.where(outside, FAR, long.z))
    made = scene(long, angle, markers=[0.0, 20.0])
    whole, part = frame(made), frame(replace(made, path=moved))
    np.testing.assert_array_equal(whole, part)
    # Seven turns of 18 mm stand on the cylinder, each 17 px wide.
    assert cable_pixels(whole).sum() > 7 * 17


def test_a_long_run_shows_the_same_turns_as_a_short_one() -> None:
    """Whole turns later the old turns stand where they stood; only new ones have come."""
    short, long = 2.0 * np.pi * 4, 2.0 * np.pi * 40
    path = helix(long + 1.0)
    early, late = (frame(scene(path, angle)) for angle in (short, long))
    left = slice(0, 300)  # before the fourth turn, which the short run has only begun
    off = np.abs(early[:, left].astype(int) - late[:, left])
    # Sections lie elsewhere on the cable, 0.01 px off: at an edge one of the four samples of a
    # pixel may fall on the other side, which is rare.
    assert off.mean() < 0.01
    assert off.max() < 30


def test_a_traverse_that_comes_back_into_the_window_is_drawn() -> None:
    theta = np.arange(0.0, 121.0, 0.02)
    # Out to 0.17 m, beyond the window, and back to 0.05 m.
    z = np.where(theta < 60.0, PITCH * theta, 2.0 * PITCH * 60.0 - PITCH * theta)
    path = CablePath(theta=theta, z=z)
    angle, marker = 102.0, 102.0 - 0.1
    made = scene(path, angle, markers=[marker])
    band = Renderer(CONFIG).visible_bands(made)[0]
    # 6 mm by 4 mm at 4.2 px/mm, seen almost from before.
    assert band["area"] == pytest.approx(6 * 4 * 4.2**2, rel=0.1)
    np.testing.assert_allclose(band["centroid"], band["centre"], atol=3.0)  # 0.1 r is 0.9 px
    ahead = replace(made, path=CablePath(theta=theta, z=np.where(theta < 60.0, FAR, z)))
    assert cable_pixels(frame(made)).sum() > cable_pixels(frame(ahead)).sum()


def test_coarse_and_irregular_paths_are_drawn_like_fine_ones() -> None:
    fine = helix(60.0)
    coarse = CablePath(theta=np.array([0.0, 0.3, 59.0]), z=PITCH * np.array([0.0, 0.3, 59.0]))
    pictures = [frame(scene(path, 33.0, markers=[30.0])) for path in (fine, coarse)]
    # The same straight line: only the rounding of grey levels differs.
    np.testing.assert_allclose(pictures[0].astype(int), pictures[1], atol=1)


def test_what_the_cable_has_left_shows_the_background_again() -> None:
    path = helix(60.0)
    renderer = Renderer(CONFIG)
    scenes = [scene(path, angle, markers=[0.0, 3.0]) for angle in (30.0, 3.0, 0.2, 12.0)]
    used = [frame(made, renderer) for made in scenes]
    np.testing.assert_array_equal(used, [frame(made) for made in scenes])


def test_a_cylinder_of_another_size_replaces_the_whole_background() -> None:
    path = helix(60.0)
    renderer = Renderer(CONFIG)
    frame(scene(path, 30.0), renderer)
    thin = scene(path, 8.0, cylinder_radius=0.006)
    np.testing.assert_array_equal(frame(thin, renderer), frame(thin))


def test_two_windows_of_one_sensor_show_the_same_cable() -> None:
    """What a window leaves out is found by its own rays: the parts of a sensor fit together."""
    made = scene(helix(60.0), 33.0, markers=[30.0], cylinder_radius=0.01)
    whole = Window(x_offset=0, y_offset=90, width=1920, height=900, binning=3)
    part = replace(whole, x_offset=600, y_offset=360, width=480, height=300)
    # The light falls off from the middle of each window.
    even = replace(CONFIG, tilt=(0.01, -0.02, 0.03), light=replace(CONFIG.light, falloff=0.0))
    picture, cut = (
        Renderer(replace(even, window=window)).render(made, np.random.default_rng(0))
        for window in (whole, part)
    )
    np.testing.assert_allclose(picture[90:190, 200:360].astype(int), cut, atol=1)


def test_a_path_is_copied_and_cannot_be_changed() -> None:
    theta, z = np.arange(3.0), np.zeros(3)
    path = CablePath(theta=theta, z=z)
    z[:] = 1.0
    assert (path.z == 0.0).all()
    with pytest.raises(ValueError, match="read-only"):
        path.z[0] = 1.0


CASE = paper_case(4)


def restless(angle: float) -> float:
    """Where a carriage stands that winds back and forth, over the cylinder's angle [rad]."""
    return 3.0e-3 * angle + 8.0e-3 * np.sin(0.7 * angle)


def wound(seed: int, *angles: float) -> tuple[DrivenLay, SeenLay, int]:
    """A lay and what a camera has seen of it, wound to one angle after the other [rad]."""
    lay = DrivenLay(CASE, HiddenRig.drawn(np.random.default_rng(seed)))
    shown = GrowingLay(lay.view())
    seen, counted = shown.at(0.0, None), 0
    for angle in angles:
        start, step = lay.contact.angle, 9.0e-3
        parts = max(round(abs(angle - start) / step), 1)
        for k in range(1, parts + 1):
            at = start + (angle - start) * k / parts
            lay.advance(at, restless(at), CASE.weight)
            view = lay.view()
            counted += view.growth.theta.size
            seen = shown.at(0.0, view)
    return lay, seen, counted


ROUTES = [(0.3,), (15.0,), (15.0, 9.0), (15.0, 9.0, 22.0), (8.0, -1.0, 3.0), (4.0, 3.99, 4.1)]


@pytest.mark.parametrize("route", ROUTES)
def test_the_path_is_the_lay_and_the_kernels_find_their_way_in_it(route: tuple[float, ...]) -> None:
    lay, seen, _ = wound(3, *route)
    path, end = seen.path.table, lay.wound_angle
    theta = np.linspace(0.0, end, 997)
    z = lay.z_at(theta)
    np.testing.assert_allclose(seen.path.height(theta), z, rtol=0, atol=1.0e-12)
    found = [path_height(path.theta, path.z, path.lift, path.first, at)[0] for at in theta]
    np.testing.assert_allclose(found, z, rtol=0, atol=1.0e-12)
    # No part of the path is left out where it crosses a height.
    for start in theta[:-30:29]:
        inside = (theta >= start) & (theta <= start + 0.2)
        low, high = z[inside].min(), z[inside].max()
        assert path_crosses(path, start, start + 0.2, low, low)
        assert path_crosses(path, start, start + 0.2, high, high)


def test_no_crossing_is_found_where_nothing_lies() -> None:
    _, seen, _ = wound(3, 30.0)
    path = seen.path.table
    assert not path_crosses(path, 2.0, 3.0, 0.2, 0.3)
    # Later turns lie elsewhere than the first one.
    assert not path_crosses(path, 0.0, 1.0, path.z.max(), path.z.max())


@pytest.mark.parametrize("route", ROUTES)
def test_it_is_drawn_as_a_path_that_is_known(route: tuple[float, ...]) -> None:
    lay, seen, _ = wound(4, *route)
    table = seen.path.table
    known = CablePath(theta=table.theta, z=table.z)
    pictures = []
    for path in (seen.path, known):
        made = seen._replace(path=path).scene(CASE, lay.wound_angle)
        pictures.append(Renderer(CameraConfig()).render(made, np.random.default_rng(0)))
    np.testing.assert_array_equal(*pictures)


def test_the_lay_goes_on_beyond_the_contact_line_in_its_direction() -> None:
    lay, seen, _ = wound(3, 15.0)
    ahead = lay.wound_angle + 0.01
    # The direction is that since the last kept point, of a lay that bends by 1 mm/rad^2.
    expected = lay.z + 0.01 * lay.contact.slope
    assert seen.path.height(np.array(ahead)) == pytest.approx(expected, abs=0.5e-6)


def test_every_point_is_passed_on_once() -> None:
    lay, _, counted = wound(3, 40.0)
    # P0 was viewed before the first step.
    assert counted == lay.path.theta.size - 1


def test_points_are_kept_beyond_the_room_that_was_made_for_them() -> None:
    path = GrowingPath()
    theta = 0.02 * np.arange(20_000)
    path.grow(0, theta[:1], theta[:1])
    path.end(0.0, 0.0, 0.0)
    path.grow(1, theta[1:], 1.0e-3 * theta[1:])
    path.end(400.0, 0.4, 1.0e-3)
    at = np.array([0.5, 399.5, 399.99])
    np.testing.assert_allclose(path.height(at), 1.0e-3 * at, rtol=1.0e-9)
    assert path_crosses(path.table, 390.0, 391.0, 0.3905, 0.3906)


def test_more_than_there_is_cannot_be_kept() -> None:
    with pytest.raises(ValueError, match="a path of 0 points cannot keep 3"):
        GrowingPath().grow(3, np.empty(0), np.empty(0))
