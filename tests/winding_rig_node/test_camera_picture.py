"""What the simulated camera shows, against geometry and an independent renderer."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from polygon import draw_polygons

from winding_core.helix import FleetAngleLaw
from winding_rig_node.camera import (
    CablePath,
    CameraConfig,
    Light,
    Patch,
    Renderer,
    Scene,
    SensorNoise,
    Surroundings,
    Window,
    encode_jpeg,
)
from winding_rig_node.camera.config import NOMINAL_AXES
from winding_rig_node.camera.optics import project_points, sample_rays

QUIET = SensorNoise(read=0.0, shot=0.0)
STILL = replace(CameraConfig(), noise=QUIET)
# The part of the full sensor that the cable reaches, and a strip of it along the motion.
REACHED = Window(x_offset=240, y_offset=100, width=1000, height=880, binning=1)
FINE = replace(CameraConfig(), noise=QUIET, window=REACHED)
STRIP = replace(FINE, window=replace(REACHED, x_offset=320, width=80))
FLAT = Light(ambient=1.0, highlight=0.0, falloff=0.0)


def scene(angle: float = 6.4, radius: float = 0.015, cable: float = 0.002, **changes: Any) -> Scene:
    law = FleetAngleLaw(advance_per_radian=2.87e-3, free_length=0.198, radius=radius + cable)
    theta = np.linspace(0.0, 40.0, 1001)
    made = Scene(
        cylinder_radius=radius,
        cable_radius=cable,
        cylinder_angle=angle,
        path=CablePath(theta=theta, z=law.z(theta)),
        marker_theta=np.array([0.0, 6.1, 12.2]),
        guide_z=2.87e-3 * angle,
        free_length=0.198,
    )
    return replace(made, **changes)


def picture(
    config: CameraConfig, made: Scene, seed: int = 0, surroundings: Surroundings | None = None
) -> np.ndarray:
    return Renderer(config, surroundings).render(made, np.random.default_rng(seed))


def yellow(frame: np.ndarray) -> np.ndarray:
    hsv = cv2.cvtColor(frame, cv2.COLOR_BGR2HSV)
    return cv2.inRange(hsv, (18, 110, 30), (38, 255, 255)) > 0


def centroid(mask: np.ndarray) -> np.ndarray:
    rows, columns = np.nonzero(mask)
    return np.array([columns.mean(), rows.mean()])


def test_default_calibration_is_that_of_the_designed_camera() -> None:
    info = CameraConfig().calibration()
    # docs/vision.md: 12.5 px/mm on a sensor of 1920 x 1080, from 392 mm before the cable.
    assert (info.width, info.height) == (1920, 1080)
    assert info.k[0, 0] == info.k[1, 1] == 12.5 * 392.0
    # Made up, of the size that lenses have: a principal point off the middle and a barrel.
    assert info.k[:2, 2].tolist() == [960.0 + 3.2, 540.0 - 3.4]
    assert info.distortion_model == "plumb_bob"
    assert info.d.tolist() == [-0.12, 0.05, 4.0e-4, -3.0e-4, 0.0]
    # docs/vision.md: the live window, 1920 x 288 about the cylinder's axis, binned by 3.
    assert (info.roi, info.binning) == ((0, 393, 1920, 288), 3)


def test_resolution_is_that_of_the_paper_at_the_cylinder() -> None:
    ends = np.array([[0.03, 0.0, 0.045], [0.03, 0.0, 0.055]])
    pixels = project_points(CameraConfig().full_frame(), ends)
    # 12.5 px/mm as designed; 2 % is the change of distance over the cylinder radii.
    assert np.linalg.norm(pixels[1] - pixels[0]) / 10.0 == pytest.approx(12.5, rel=0.03)


def test_window_shows_the_whole_winding_range() -> None:
    config = CameraConfig()
    rows, columns = config.window.shape
    assert (rows, columns) == (96, 640)
    pixels = project_points(config, np.array([[0.017, 0.0, -0.015], [0.017, 0.0, 0.115]]))
    assert (pixels[:, 0] > 0).all()
    assert (pixels[:, 0] < columns - 1).all()


def test_image_right_is_feed_and_image_down_is_rotation() -> None:
    config = CameraConfig()
    pixels = project_points(
        config, np.array([[0.017, 0.0, 0.05], [0.017, 0.0, 0.06], [0.016, 0.003, 0.05]])
    )
    assert pixels[1, 0] > pixels[0, 0]
    assert pixels[2, 1] > pixels[0, 1]


def test_binned_window_and_full_frame_see_the_same_point() -> None:
    config = CameraConfig()
    point = np.array([[0.0165, 0.004, 0.031]])
    binned = project_points(config, point)[0]
    full = project_points(config.full_frame(), point)[0]
    window = config.window
    back = np.array([window.x_offset, window.y_offset]) + window.binning * (binned + 0.5) - 0.5
    np.testing.assert_allclose(back, full, atol=1e-9)  # the same arithmetic twice


def test_rays_invert_the_distortion() -> None:
    config = replace(CameraConfig(), distortion=(-0.35, 0.12, 1e-3, -8e-4, 0.0), supersampling=1)
    rays = sample_rays(config, 0, 96)
    points = np.array(config.position) + 0.4 * rays[::31, ::97].reshape(-1, 3)
    rows, columns = np.meshgrid(np.arange(0, 96, 31), np.arange(0, 640, 97), indexing="ij")
    pixels = project_points(config, points)
    np.testing.assert_allclose(pixels[:, 0], columns.ravel(), atol=1e-6)  # 1e-12 f / binning
    np.testing.assert_allclose(pixels[:, 1], rows.ravel(), atol=1e-6)


def test_a_distortion_that_folds_the_picture_is_refused() -> None:
    config = replace(CameraConfig().full_frame(), distortion=(-40.0, 0.0, 0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="cannot be inverted"):
        sample_rays(replace(config, supersampling=1), 0, 8)


def test_projection_agrees_with_opencv() -> None:
    config = CameraConfig().full_frame()
    points = np.array([[0.015, 0.0, 0.05], [0.0175, 0.03, -0.02], [0.01, -0.025, 0.115]])
    info = config.calibration()
    seen, _ = cv2.projectPoints(
        points,
        cv2.Rodrigues(NOMINAL_AXES.T)[0],
        -NOMINAL_AXES.T @ np.array(config.position),
        info.k,
        info.d,
    )
    # One formula in two programs, at a thousand pixels.
    np.testing.assert_allclose(project_points(config, points), seen.reshape(-1, 2), atol=1e-9)


@pytest.mark.slow
def test_visible_bands_agree_with_an_independent_polygon_renderer() -> None:
    # No band below leaves these rows.
    window = replace(REACHED, y_offset=400, height=320, binning=2)
    config = replace(FINE, window=window, light=FLAT, supersampling=4, tilt=(3e-3, -5e-3, 4e-3))
    off = []
    for angle in (0.0, 0.4, 6.4, 12.8, 25.0):
        late = np.array([angle - 0.3]) if angle > 0.4 else np.array([0.0])
        made = scene(angle, marker_theta=late)
        ours = centroid(yellow(picture(config, made)))
        off.append(ours - centroid(yellow(draw_polygons(config, made))))
    # Polygon corners are rounded to 1/16 of a sample, edges inclusive: 0.16 px is what a
    # polygon renderer was measured to be good for at twice this resolution.
    np.testing.assert_allclose(off, 0.0, atol=0.16)


@pytest.mark.slow
def test_ground_truth_is_the_centroid_of_the_picture() -> None:
    config = replace(FINE, light=FLAT)
    made = scene(0.3)
    renderer = Renderer(config)
    band = renderer.visible_bands(made)[0]
    mask = yellow(renderer.render(made, np.random.default_rng(0)))
    # Threshold on mixed pixels against exact samples: both edges lose the same.
    np.testing.assert_allclose(centroid(mask), band["centroid"], atol=0.1)
    assert mask.sum() == pytest.approx(band["area"], rel=0.05)


@pytest.mark.slow
def test_the_visible_centroid_is_not_the_centre_line() -> None:
    band = Renderer(FINE).visible_bands(scene(0.6))[0]
    off = band["centroid"] - band["centre"]
    assert 5.0 < off[1] < 25.0  # 0.6 r sin(0.6) is 0.7 mm, 8 px


@pytest.mark.slow
def test_a_band_moves_down_the_free_span_by_the_cylinder_way() -> None:
    renderer = Renderer(FINE)
    late = np.array([6.5])
    before = renderer.visible_bands(scene(6.1, marker_theta=late))[0]["centre"]
    after = renderer.visible_bands(scene(6.2, marker_theta=late))[0]["centre"]
    way = 0.1 * 0.017 * FINE.focal / (FINE.position[0] - 0.017)
    assert after[1] - before[1] == pytest.approx(way, rel=0.01)


def test_the_far_side_is_hidden_and_an_unknown_marker_is_not_drawn() -> None:
    made = scene(math.pi, marker_theta=np.array([0.0, np.nan]))
    bands = Renderer(CameraConfig().full_frame(2)).visible_bands(made)
    assert (bands["area"] == 0.0).all()
    assert np.isnan(bands["centre"][1]).all()


def test_same_seed_same_frame() -> None:
    made = scene()
    assert (picture(CameraConfig(), made, 5) == picture(CameraConfig(), made, 5)).all()
    assert (picture(CameraConfig(), made, 5) != picture(CameraConfig(), made, 6)).any()


def test_noise_has_the_configured_deviation() -> None:
    config = replace(CameraConfig(), noise=SensorNoise(read=8.0, shot=0.0))
    still = picture(replace(config, noise=QUIET), scene()).astype(float)
    noisy = picture(config, scene()).astype(float)
    # 180,000 samples know their deviation to 0.2 %; rounding adds 1/12 grey level squared.
    assert (noisy - still).std() == pytest.approx(math.hypot(8.0, math.sqrt(2 / 12)), rel=0.02)


def test_light_scales_grey_levels() -> None:
    dark = picture(replace(CameraConfig(), noise=QUIET, light=Light(gain=0.5)), scene())
    full = picture(STILL, scene())
    np.testing.assert_allclose(dark, 0.5 * full, atol=1.0)  # rounding of both


def test_flicker_changes_light_from_frame_to_frame() -> None:
    renderer = Renderer(replace(CameraConfig(), light=Light(flicker=0.5), noise=QUIET))
    rng = np.random.default_rng(3)
    means = [renderer.render(scene(), rng).mean() for _ in range(20)]
    assert 1.3 < max(means) / min(means) < 2.3


@pytest.mark.slow
def test_motion_blur_smears_along_the_motion() -> None:
    made = scene(0.2, cylinder_speed=1.74)
    blurred = replace(STRIP, exposure=0.02, exposure_samples=9)
    # Way of the surface during the exposure, in pixels.
    way = 1.74 * 0.02 * 0.019 * STRIP.focal / (STRIP.position[0] - 0.019)
    edge = [
        np.abs(np.diff(picture(config, made)[:, 40, 0].astype(float))).max()
        for config in (STRIP, blurred)
    ]
    assert way > 5.0
    assert edge[1] < 0.5 * edge[0]


def test_defocus_softens_edges() -> None:
    edge = [
        np.abs(np.diff(picture(config, scene()).astype(float), axis=1)).max()
        for config in (STILL, replace(STILL, defocus=3.0))
    ]
    assert edge[1] < 0.4 * edge[0]


def test_bayer_keeps_flat_regions_and_colours_edges() -> None:
    plain, filtered = (
        picture(STILL, scene(0.2)).astype(float),
        picture(replace(STILL, bayer=True), scene(0.2)).astype(float),
    )
    assert np.abs(filtered - plain).mean() < 3.0
    assert np.abs(filtered - plain).max() > 20.0
    assert centroid(yellow(filtered.astype(np.uint8))) == pytest.approx(
        centroid(yellow(plain.astype(np.uint8))), abs=0.3
    )


def test_a_rod_hides_the_cable_and_a_decoy_does_not() -> None:
    spot = {"column": 960.0, "row": 536.0, "width": 1920.0, "height": 60.0}
    rod = Surroundings(patches=(Patch(**spot, colour=(40, 40, 40), in_front=True),))
    decoy = Surroundings(patches=(Patch(**spot, colour=(20, 200, 240)),))
    made = scene(0.0)
    assert yellow(picture(STILL, made)).sum() > 200
    assert yellow(picture(STILL, made, surroundings=rod)).sum() < 150
    behind = picture(STILL, made, surroundings=decoy)
    assert yellow(behind)[:, :40].sum() > 500
    assert yellow(behind)[:, 100:140].sum() == yellow(picture(STILL, made))[:, 100:140].sum()


def test_a_photograph_fills_the_backdrop_only() -> None:
    photo = np.random.default_rng(1).integers(0, 255, (50, 80, 3)).astype(np.uint8)
    config = replace(CameraConfig().full_frame(3), noise=QUIET)
    plain = picture(config, scene())
    filled = picture(config, scene(), surroundings=Surroundings(photograph=photo))
    changed = (plain != filled).any(axis=2)
    assert changed[:40].mean() > 0.9
    assert changed[175:185, 100:500].mean() == 0.0


def test_preview_is_a_jpeg_of_the_frame() -> None:
    frame = picture(CameraConfig(), scene())
    data = encode_jpeg(frame, quality=90, shrink=2)
    back = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    assert data[:2] == b"\xff\xd8"
    assert back.shape == (48, 320, 3)
    small = cv2.resize(frame, (320, 48), interpolation=cv2.INTER_AREA)
    assert np.abs(back.astype(float) - small).mean() < 4.0  # loss of quality 90


IMPOSSIBLE = [
    (lambda: CameraConfig(focal=0.0), "focal"),
    (lambda: CameraConfig(encoding="mono8"), "encoding"),
    (lambda: CameraConfig(width=100), "ends at column"),
    (lambda: CameraConfig(defocus=-1.0), "defocus"),
    (lambda: SensorNoise(read=-1.0), "read noise"),
    (lambda: Light(gain=0.0), "gain"),
    (lambda: Light(ambient=1.5), "ambient"),
    (lambda: CablePath(theta=np.zeros(2), z=np.zeros(3)), "one length"),
    (lambda: CablePath(theta=np.zeros(2), z=np.zeros(2)), "ascend"),
    (lambda: CablePath(theta=np.arange(2.0), z=np.array([0.0, np.nan])), "finite"),
    (lambda: scene(cylinder_angle=math.nan), "finite"),
    (lambda: scene(cable_radius=-1.0), "cable_radius"),
    (lambda: Patch(column=0, row=0, width=0, height=1, colour=(0, 0, 0)), "patch size"),
    (lambda: Surroundings(photograph=np.zeros((4, 4))), "photograph"),
    (lambda: encode_jpeg(np.zeros((4, 4, 3), np.uint8), quality=0), "quality"),
]


@pytest.mark.parametrize(("make", "message"), IMPOSSIBLE)
def test_impossible_descriptions_are_refused(make: Callable[[], object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()


def test_flange_hides_what_stands_behind_it_and_nothing_before_it() -> None:
    # The camera stands beside the drum and looks at its near flange from outside.
    height, ends = 0.012, (-0.002, 0.024)
    bare = scene(angle=12.0, marker_theta=np.zeros(0), cylinder_ends=ends)
    camera = replace(FINE, light=FLAT)
    without, flanged = (
        picture(camera, made).astype(int) for made in (bare, replace(bare, flange_height=height))
    )
    changed = np.argwhere(np.abs(without - flanged).max(axis=-1) > 1)
    edge = np.array([[0.0, 0.0, 0.0]])
    # The rim's silhouette ends where its tangent meets it, above and below, seen from x = 0.4175.
    radius, away = 0.015 + height, camera.position[0]
    tangent = radius * np.array([radius / away, math.sqrt(1.0 - (radius / away) ** 2)])
    edge[0] = tangent[0], tangent[1], ends[0]
    row = project_points(camera, edge)[0, 1]
    assert changed[:, 0].max() == pytest.approx(row, abs=1.0)
    # The near flange covers what lies behind the sight line over its edge, the far one covers
    # nothing that stands on the cylinder.
    sight = project_points(camera, np.array([[radius, 0.0, ends[1]], [0.015, 0.0, ends[0]]]))
    middle = changed[np.abs(changed[:, 0] - camera.centre[1] + REACHED.y_offset) < 2.0]
    near, far = middle[:, 1].max(), middle[:, 1].min()
    assert far < sight[1, 0] < sight[0, 0] < near
    between = middle[(middle[:, 1] > sight[1, 0] + 1.0) & (middle[:, 1] < sight[0, 0] - 1.0)]
    assert between.size == 0
