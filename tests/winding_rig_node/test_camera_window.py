"""What the camera draws does not depend on what its window cannot show, nor on earlier frames."""

from dataclasses import replace

import numpy as np
import pytest

from winding_rig_node.camera import CablePath, CameraConfig, Renderer, Scene, SensorNoise
from winding_rig_node.camera.config import Window

CONFIG = replace(CameraConfig(), noise=SensorNoise(read=0.0, shot=0.0))
PITCH = 2.87e-3  # dz per radian of the paper's drive
FAR = 5.0  # an axial position [m] that no window shows


def scene(path, angle, markers=(), **changes):
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


def helix(end):
    theta = np.arange(0.0, end, 0.02)
    return CablePath(theta=theta, z=PITCH * theta)


def frame(made, renderer=None):
    return (renderer or Renderer(CONFIG)).render(made, np.random.default_rng(0))


def cable_pixels(picture, renderer=None):
    """Return the columns where a frame differs from that of a bare cylinder."""
    nowhere = CablePath(theta=np.array([0.0, 1.0]), z=np.array([FAR, FAR]))
    bare = frame(scene(nowhere, 0.0, guide_z=FAR))
    return (picture.astype(int) != bare).any(axis=(0, 2))


def test_after_many_turns_the_turns_out_of_the_window_make_no_difference():
    angle = 346.0
    long = helix(angle + 1.0)
    outside = (long.z > 0.16) | (long.z < -0.03)
    moved = CablePath(theta=long.theta, z=np.where(outside, FAR, long.z))
    made = scene(long, angle, markers=[0.0, 20.0])
    whole, part = frame(made), frame(replace(made, path=moved))
    np.testing.assert_array_equal(whole, part)
    # Seven turns of 18 mm stand on the cylinder, each 17 px wide.
    assert cable_pixels(whole).sum() > 7 * 17


def test_a_long_run_shows_the_same_turns_as_a_short_one():
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


def test_a_traverse_that_comes_back_into_the_window_is_drawn():
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


def test_coarse_and_irregular_paths_are_drawn_like_fine_ones():
    fine = helix(60.0)
    coarse = CablePath(theta=np.array([0.0, 0.3, 59.0]), z=PITCH * np.array([0.0, 0.3, 59.0]))
    pictures = [frame(scene(path, 33.0, markers=[30.0])) for path in (fine, coarse)]
    # The same straight line: only the rounding of grey levels differs.
    np.testing.assert_allclose(pictures[0].astype(int), pictures[1], atol=1)


def test_what_the_cable_has_left_shows_the_background_again():
    path = helix(60.0)
    renderer = Renderer(CONFIG)
    scenes = [scene(path, angle, markers=[0.0, 3.0]) for angle in (30.0, 3.0, 0.2, 12.0)]
    used = [frame(made, renderer) for made in scenes]
    fresh = [frame(made) for made in scenes]
    np.testing.assert_array_equal(used, fresh)


def test_a_cylinder_of_another_size_replaces_the_whole_background():
    path = helix(60.0)
    renderer = Renderer(CONFIG)
    frame(scene(path, 30.0), renderer)
    thin = scene(path, 8.0, cylinder_radius=0.006)
    np.testing.assert_array_equal(frame(thin, renderer), frame(thin))


def test_two_windows_of_one_sensor_show_the_same_cable():
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


def test_a_path_is_copied_and_cannot_be_changed():
    theta, z = np.arange(3.0), np.zeros(3)
    path = CablePath(theta=theta, z=z)
    z[:] = 1.0
    assert (path.z == 0.0).all()
    with pytest.raises(ValueError, match="read-only"):
        path.z[0] = 1.0
