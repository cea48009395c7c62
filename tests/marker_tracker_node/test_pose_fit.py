"""Joint refinement of marks and pose, and deviations against errors over random scenes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from marker_film import DRIVE, FINE, GRID, SENSOR, TURN, UNSEEN, Film, marked_lay

from marker_tracker_node import CameraPose, PinholeCamera, Sightings, refine
from winding_core.cable.cases import Case
from winding_core.helix import FleetAngleLaw
from winding_rig_node.camera import CameraConfig, Light, SensorNoise, Window
from winding_verification.tracker.drawn_runs import quick, sightings
from winding_verification.tracker.scenes import World, WrongNumber

pytestmark = pytest.mark.slow
WINDOWS = (
    FINE,
    FINE,
    replace(FINE, width=1200, binning=2),
    Window(),
    Window(y_offset=0, height=1080),
)


@pytest.mark.parametrize(
    ("case", "tilt", "theta_bar", "z_bar"),
    [
        (9, (-9e-3, 4e-3, 6e-3), 0.5e-3, 0.02e-3),
        # Cable of 4 mm on 30 mm: the first two turns touch.
        (4, (6e-3, -9e-3, 5e-3), 2.0e-3, 0.05e-3),
    ],
)
def test_a_wrong_pose_is_found_and_spoils_no_marker(smooth_film, case, tilt, theta_bar, z_bar):
    film = smooth_film(case, camera=replace(SENSOR, tilt=tilt))
    tracker, *_ = film.followed(7.0, film.tracker(pose=CameraPose()))
    assert tracker.report().known == 5
    fit = refine(tracker.config, tracker.camera, tracker.sightings())
    # The specification's bars.
    assert np.abs(fit.theta - film.theta).max() <= theta_bar
    assert np.abs(fit.z - film.z).max() <= z_bar
    np.testing.assert_allclose(fit.pose.tilt, tilt, atol=1.5e-3)
    assert fit.residual < 0.5


def test_refining_needs_sightings(paper_film):
    tracker = paper_film(4).tracker()
    with pytest.raises(ValueError, match="at least 20"):
        refine(tracker.config, tracker.camera, tracker.sightings())


def test_p0_zeroes_the_pose_in_the_first_frame(paper_film):
    film = paper_film(4, camera=replace(CameraConfig(), tilt=(8e-3, -6e-3, 0.0)))
    tracker = film.tracker(pose=CameraPose())
    tracker.track(film.frame_at(0.0), 0.0, 0.0, 0.0)
    # 0.4 px of the binned window are 0.24 mrad: one frame, and P0 sits where the bend begins.
    np.testing.assert_allclose(tracker.pose.tilt, (8e-3, -6e-3, 0.0), atol=0.25e-3)
    assert isinstance(tracker.camera, PinholeCamera)


def lay_of(case, rng):
    """A cable that wanders about the law of a free length of its own and never lies in itself."""
    rho, diameter = case.centreline_radius, 2.0 * case.cable_radius
    law = FleetAngleLaw(
        advance_per_radian=DRIVE.advance_per_radian, free_length=rng.uniform(0.17, 0.23), radius=rho
    )
    turn = round(2.0 * math.pi / 0.01)
    wave, phase = rng.uniform(4.0, 15.0), rng.uniform(0.0, 2.0 * math.pi)
    sway = np.sin(2.0 * math.pi * GRID / wave + phase) - math.sin(phase)
    rise = 1.0 - np.exp(-GRID / 2.0)
    z = law.z(GRID) + rng.uniform(0.0, 0.25e-3) * sway * rise
    lack = rng.uniform(1.0, 1.03) * diameter - (z[turn:] - z[:-turn])
    z += max(float((lack / np.maximum(rise[turn:] - rise[:-turn], 0.02)).max()), 0.0) * rise
    return marked_lay(case, z, rng.uniform(1.0, 1.05))


def followed(seed, tilt_sigma=0.0, position_sigma=0.0, patience=2.0):
    """A film, its tracker after the run, and errors and deviations of its single frames.

    The run ends early where no marker is known after some turns, which is the patience: the search
    for one takes most of the time, and no scene of these tests yields one later.
    """
    rng = np.random.default_rng(seed)
    cylinder = float(rng.choice([30.0, 60.0, rng.uniform(25.0, 80.0)], p=[0.35, 0.35, 0.3]))
    cable = float(min(rng.choice([2.0, 4.0, 6.0, rng.uniform(1.5, 7.0)]), 0.22 * cylinder))
    turn = math.pi * (cylinder + cable)
    case = Case(
        cylinder_diameter=1.0e-3 * cylinder,
        cable_diameter=1.0e-3 * cable,
        weight=1.0,
        marker_spacing=1.0e-3 * turn * rng.uniform(0.87, 1.06),
        marker_count=4 if cylinder <= 45.0 else 3,
    )
    window = WINDOWS[rng.integers(len(WINDOWS))]
    narrow = window.height < 400
    tilt = rng.normal(0.0, 2.4e-3 if narrow else 6.0e-3, 3)
    position = rng.normal([0.4175, 0.0, 0.05], [10e-3, 1.5e-3 if narrow else 5e-3, 5e-3])
    camera = CameraConfig(
        focal=4900.0 * rng.uniform(0.85, 1.05),
        tilt=tuple(tilt),
        position=tuple(position),
        window=window,
        noise=SensorNoise(read=math.exp(rng.uniform(-0.7, 1.8)), shot=rng.uniform(0.0, 0.06)),
        light=Light(
            gain=rng.uniform(0.6, 1.5),
            direction=(1.0, rng.uniform(-0.5, 0.5), rng.uniform(-0.3, 0.3)),
            highlight=rng.uniform(0.0, 0.2),
        ),
        defocus=float(rng.choice([0.0, rng.uniform(0.2, 1.2)])),
        bayer=bool(rng.random() < 0.15),
    )
    film = Film(case=case, lay=lay_of(case, rng), camera=camera, seed=seed)
    believed = CameraPose(
        position=tuple(position + position_sigma * rng.normal(size=3)),
        tilt=tuple(tilt + tilt_sigma * rng.normal(size=3)),
    )
    tracker = film.tracker(pose=believed, expected_stretch=1.02)
    fps, first = 8.0 if narrow else 4.0, patience * TURN / DRIVE.angular_speed + 0.5
    _, records, _ = film.followed(fps, tracker, stop=first)
    if tracker.report().known:
        stop = (film.theta[-1] + 5.0) / DRIVE.angular_speed + 0.5
        _, rest, _ = film.followed(fps, tracker, start=first, stop=stop)
        records = np.concatenate([records, rest])
    use = ((records["flags"] & UNSEEN) == 0) & (records["id"] > 0)
    return film, tracker, scores_of(film, records)[use]


def scores_of(film, records, markers=slice(None)):
    """Errors of theta and z over their deviations, shape (..., markers, 2)."""
    theta = (records["theta"] - film.theta[markers]) / records["sigma_theta"]
    z = (records["z"] - film.z[markers]) / records["sigma_z"]
    return np.stack([theta, z], axis=-1)


def require_coverage(scores):
    """Hold the specification: rms 0.8 to 1.3, 95 % within two deviations within 3 points."""
    scores = np.concatenate(scores)
    rms = np.sqrt((scores**2).mean(axis=0))
    within = (np.abs(scores) < 2.0).mean(axis=0)
    assert ((rms >= 0.8) & (rms <= 1.3)).all(), (rms, within)
    assert (within >= 0.92).all(), (rms, within)


def mean_scores(film, tracker):
    """Errors of the run means over their deviations, shape (markers, 2)."""
    scores = scores_of(film, tracker.estimates()[1:], slice(1, None))
    return scores[np.isfinite(scores).all(axis=1)]


@pytest.mark.campaign
@pytest.mark.timeout(1800)
def test_deviations_cover_the_errors_of_two_hundred_scenes():
    frames, means = [], []
    for seed in range(1000, 1200):
        film, tracker, scores = followed(seed)
        if tracker.report().known > 1:
            frames.append(scores)
            means.append(mean_scores(film, tracker))
    require_coverage(frames)
    require_coverage(means)


@pytest.mark.parametrize("seed", [2001, 2002, 2003])
def test_a_right_pose_is_left_alone(seed):
    _, tracker, _ = followed(seed)
    fit = refine(tracker.config, tracker.camera, tracker.sightings())
    assert not fit.moved.any()
    means, seen = tracker.estimates(), np.isfinite(fit.theta)
    assert seen.sum() >= 3
    np.testing.assert_array_equal(fit.theta[seen], means["theta"][seen])
    np.testing.assert_array_equal(fit.z[seen], means["z"][seen])


def painted(seed, share):
    """A configuration, its camera, and sightings of bands that are thicker than the cable."""
    world = quick(World.drawn(seed))
    thin = WrongNumber(number="cable_diameter", size=-share)
    seen = sightings(world, (thin,), seed)
    known = np.zeros((2, world.marker_count + 1))
    return (
        thin.config(world.config()),
        world.pinhole(),
        Sightings(rows=seen.rows, pose=seen.used, means=known),
    )


@pytest.mark.parametrize("share", [-0.02, 0.02])
def test_paint_that_is_not_as_thick_as_the_cable_moves_no_right_pose(share):
    # Two of these scenes moved by six deviations when paint was taken for cable.
    for seed in range(10):
        fit = refine(*painted(seed, share))
        assert (np.abs(fit.moved) <= fit.sigma_pose).all(), seed


def refined(seeds):
    """Yield film, tracker and fit of the scenes that yield the sightings that a fit needs."""
    for seed in seeds:
        film, tracker, _ = followed(seed, tilt_sigma=10e-3, position_sigma=2e-3, patience=0.5)
        seen = tracker.sightings()
        if len(seen.rows) >= 20 and (seen.rows[:, 0] == 0).any():
            yield film, tracker, refine(tracker.config, tracker.camera, seen)


def test_a_pose_wrong_by_its_belief_is_mended():
    before, after = [], []
    for film, tracker, fit in refined(range(3001, 3007)):
        before.append(tracker.estimates()["theta"] - film.theta)
        after.append(fit.theta - film.theta)
    # Poses below four deviations stay as they are: a quarter of the squared error may remain.
    wrong, right = (np.nanmean(np.concatenate(part) ** 2) for part in (before, after))
    assert right < 0.25 * wrong


def test_a_scale_corrected_beside_the_pose_turns_no_refined_marker():
    # Some of the turn was taken for an encoder that is 0.03 % fast: 4.3 and 3.2 deviations.
    for film, tracker, fit in refined((8085, 8136)):
        assert tracker.report().remarks
        assert np.nanmax(np.abs(fit.theta - film.theta)[1:] / fit.sigma_theta[1:]) < 3.0


@pytest.mark.campaign
@pytest.mark.timeout(1800)
def test_deviations_cover_the_errors_of_refined_markers():
    scores = []
    # About half of the scenes yield the sightings that a refinement needs.
    for film, _, fit in refined(range(8000, 8080)):
        theta = (fit.theta[1:] - film.theta[1:]) / fit.sigma_theta[1:]
        z = (fit.z[1:] - film.z[1:]) / fit.sigma_z[1:]
        both = np.column_stack([theta, z])
        scores.append(both[np.isfinite(both).all(axis=1)])
    require_coverage(scores)
