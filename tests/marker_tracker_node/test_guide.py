"""Guide readings with another zero, scale or sign; guides that dwell, go back or are commanded."""

import math
from functools import partial

import numpy as np
import pytest
from marker_film import DRIVE, FREE_LENGTH, GRID, TURN, Film, dark_where, encoder, marked_lay

from winding_core.cable.cases import Case, paper_case
from winding_core.markers import MarkerFlag
from winding_rig_node.camera import CameraConfig, Renderer, SensorNoise
from winding_rig_node.camera.shown_lay import GrowingLay
from winding_rig_node.lay.driven_lay import DrivenLay
from winding_rig_node.lay.lay_on import HiddenRig

pytestmark = pytest.mark.slow

FEED = DRIVE.advance_per_radian
STEADY = FEED * GRID
SIZES = [(30.0, 2.0), (30.0, 4.0), (45.0, 3.0), (60.0, 4.0), (60.0, 6.0)]
# Every eightieth sample of the machine is a frame.
PERIOD = 80


def steps(*stretches):
    """Where a guide stands over GRID that from angles on moves so many times as far as the feed."""
    rate = np.zeros_like(GRID)
    for start, share in stretches:
        rate[start <= GRID] = share * FEED
    return np.concatenate([[0.0], np.cumsum(0.01 * rate[:-1])])


# A cable that follows its guide a free length behind lies free of itself in all of these.
FREE_OF_ITSELF = {
    "dwells at the start": steps((0.0, 0.0), (1.5, 1.2)),
    "dwells for a turn": steps((0.0, 1.0), (5.0, 0.0), (5.0 + 1.1 * TURN, 1.0)),
    "starts backwards": steps((0.0, -1.0), (0.6, 1.2)),
    "goes back for a while": steps((0.0, 1.0), (7.0, -0.5), (9.5, 1.0)),
    "reverses at its end": steps((0.0, 1.0), (16.0, -0.6)),
}


def sized(cylinder, cable):
    """A case of a size of its own [mm]."""
    gap = 0.98 * math.pi * (cylinder + cable)
    return Case(
        cylinder_diameter=1.0e-3 * cylinder,
        cable_diameter=1.0e-3 * cable,
        weight=1.0,
        marker_spacing=1.0e-3 * gap,
        marker_count=4 if cylinder < 45 else 3,
    )


def film_of(case, guide, seed):
    """A film of a cable that follows a guide, which stands so over GRID."""
    lag = FREE_LENGTH / case.centreline_radius
    z = np.zeros_like(GRID)
    for k in range(1, GRID.size):
        z[k] = z[k - 1] + 0.01 * (guide[k - 1] - z[k - 1]) / lag
    camera = CameraConfig(noise=SensorNoise(read=1.0 + seed % 3))
    return Film(case=case, lay=marked_lay(case, z), camera=camera, seed=seed)


def wound(size, guide, seed, read=lambda angle, at: at, **changes):
    """A film, and a tracker that has followed it until the last marker has come round once more.

    Args:
        size: Of cylinder and cable [mm].
        guide: Where it stands over GRID.
        seed: Of the film.
        read: What is read of the guide, given rotation and position.
        changes: Of the tracker's configuration.
    """
    film = film_of(sized(*size), guide, seed)
    tracker = film.tracker(expected_stretch=1.0, **changes)
    dice = np.random.default_rng(seed)
    for t, angle in timed(film):
        at = float(np.interp(angle, GRID, guide))
        reading = read(angle, at) + dice.normal(0.0, 2.0e-5)
        tracker.track(film.frame_at(angle, at), t, angle, reading)
    return film, tracker


def timed(film):
    """Times and angles of a run with a start from rest, until the last marker has come again."""
    stop = (film.theta[-1] + TURN + 1.0) / DRIVE.angular_speed + 0.5
    for k in range(math.ceil(16.0 * stop)):
        yield k / 16.0, DRIVE.positions(k / 16.0)[0]


def require_right(film, tracker):
    """Hold every marker and the specification's bar of its length."""
    np.testing.assert_allclose(tracker.estimates()["s"][1:], film.s[1:], rtol=0.002)


@pytest.mark.parametrize("name", FREE_OF_ITSELF)
@pytest.mark.parametrize(("size", "seed"), [(SIZES[0], 1), (SIZES[2], 2), (SIZES[3], 3)])
def test_a_guide_that_dwells_or_goes_back_is_followed(name, size, seed):
    film, tracker = wound(size, FREE_OF_ITSELF[name], seed, lambda angle, at: at + 0.4)
    require_right(film, tracker)
    report = tracker.report()
    assert report.doubts == ()
    assert report.healthy


@pytest.mark.parametrize("offset", [17.0e-3, -21.0e-3, 15.5e-3, -0.34])
@pytest.mark.parametrize(("size", "seed"), [(SIZES[1], 4), (SIZES[4], 5)])
def test_the_zero_of_the_guide_does_not_matter(size, seed, offset):
    film, tracker = wound(size, STEADY, seed, lambda angle, at: at + offset)
    require_right(film, tracker)
    assert tracker.report().healthy


@pytest.mark.parametrize(
    ("size", "lead"),
    [
        (SIZES[1], 8.0e-3),
        (SIZES[1], 25.0e-3),
        (SIZES[2], 15.0e-3),
        (SIZES[3], -5.0e-3),
        (SIZES[3], 5.0e-3),
        (SIZES[4], 20.0e-3),
    ],
)
def test_where_the_guide_stands_as_p0_lands_is_found_out_from_the_markers(size, lead):
    film, tracker = wound(size, STEADY + lead, 6)
    require_right(film, tracker)
    assert tracker.state.run.guide.offset == pytest.approx(lead, abs=1.0e-3)


def test_markers_after_one_that_lies_on_p0s_turn_keep_their_numbers():
    film, tracker = wound((60.0, 4.0), STEADY - 10.0e-3, 9)
    known = tracker.state.marks.known
    assert known[2:].all()
    estimates = tracker.estimates()["s"]
    np.testing.assert_allclose(estimates[known], film.s[known], rtol=0.002)
    assert known[1] or 1 in tracker.report().missing


@pytest.mark.parametrize("number", [2, 10])
def test_what_passes_a_turn_later_is_not_a_marker_that_landed_on_p0(number):
    # 12 mm behind P1 merges with P0, and P2 lies where P1 would without an offset.
    film = film_of(paper_case(number), STEADY - 12.0e-3, 300 + number)
    tracker = film.tracker(expected_stretch=1.0)
    for t, angle in timed(film):
        at = float(np.interp(angle, GRID, STEADY - 12.0e-3))
        tracker.track(film.frame_at(angle, at), t, angle, at)
    known = tracker.state.marks.known
    # A turn is 6.28 rad: what is off by less has its own number.
    off = (tracker.estimates()["theta"] - film.theta)[known]
    assert np.abs(off).max() < 0.02
    assert 1 in tracker.report().missing
    assert not tracker.report().healthy


@pytest.mark.parametrize("size", [SIZES[1], SIZES[3]])
def test_a_guide_that_stands_behind_is_no_misplaced_camera(size):
    assert wound(size, STEADY - 25.0e-3, 10)[1].report().colour_refusal == ""


@pytest.mark.parametrize(
    ("read", "words"),
    [
        (lambda angle, at: 1000.0 * at, "millimetres"),
        (lambda angle, at: 85.0 - 1000.0 * at, "millimetres instead of metres, and is their sign"),
        (lambda angle, at: 0.02 - at, "sign reversed"),
        (lambda angle, at: 0.031, "scale right"),
        (lambda angle, at: 2.5 * at, "scale right"),
    ],
    ids=["mm", "reversed mm", "reversed", "stuck", "too far"],
)
@pytest.mark.parametrize(("size", "seed"), [(SIZES[0], 7), (SIZES[1], 8), (SIZES[3], 9)])
def test_readings_that_markers_contradict_are_reported_not_believed(read, words, size, seed):
    film, tracker = wound(size, STEADY, seed, read)
    require_right(film, tracker)
    report = tracker.report()
    assert words in report.guide_doubt
    assert not report.healthy


@pytest.mark.parametrize("number", [1, 9])
def test_markers_that_changed_places_in_the_dark_are_not_published_as_healthy(number):
    # P1 lands unseen, the guide 10 mm ahead as P0 landed: P2 is taken for P1, and P1 for P2.
    guide = STEADY + 10.0e-3
    film = film_of(paper_case(number), guide, number)
    tracker = film.tracker(expected_stretch=1.0)
    darkened = dark_where(lambda angle: 5.0 < angle < 9.5)
    for t, angle in timed(film):
        at = float(np.interp(angle, GRID, guide))
        tracker.track(darkened(film.frame_at(angle, at), angle), t, angle, at)
    found = tracker.estimates()
    off_theta = (found["theta"] - film.theta)[1:] / found["sigma_theta"][1:]
    off_z = (found["z"] - film.z)[1:] / found["sigma_z"][1:]
    # Of 8 numbers with normal errors one is beyond 5 deviations once in 200 000 tests.
    right = np.abs(np.concatenate([off_theta, off_z])).max() < 5.0
    assert right or not tracker.report().healthy


def test_readings_in_millimetres_are_judged_before_a_marker_lands():
    film = film_of(sized(30.0, 4.0), STEADY, 10)
    tracker = film.tracker()
    for t, angle in timed(film):
        if angle > 0.3:
            break
        tracker.track(film.frame_at(angle), t, angle, 1000.0 * FEED * angle)
    assert "millimetres" in tracker.report().guide_doubt


def test_a_feed_towards_minus_z_is_followed():
    # P3 and P4 lie beyond the picture.
    film, tracker = wound((30.0, 4.0), -STEADY, 11, marker_count=2)
    np.testing.assert_allclose(tracker.estimates()["s"][1:3], film.s[1:3], rtol=0.002)
    assert tracker.report().guide_doubt == ""


def test_markers_that_never_come_are_reported(smooth_film):
    film = smooth_film(9)
    film.theta = np.where(np.arange(film.theta.size) == 0, film.theta, math.nan)
    report = film.followed(8.0, stop=12.0)[0].report()
    assert report.known == 1
    assert report.missing == (1,)
    assert not report.healthy


def swaying(angle, carriage):
    """The feed of the programme with a sway of 3 mm, as a commander may ask for."""
    return carriage + 3.0e-3 * math.sin(angle / 3.0)


def leading(lag, angle, carriage):
    """A guide that goes ahead by its lag within a turn, as a controller of an even helix has it."""
    return carriage + DRIVE.advance_per_radian * lag * -math.expm1(-angle / 2.0)


def pulled(angle, weight):
    """A pull that a commander raises by a fifth after two turns."""
    return weight * (1.2 if angle > 4.0 * math.pi else 1.0)


def driven(case, seed, guide, samples=20_001, period=PERIOD):
    """Wind a hidden rig; yield sample, encoder reading, carriage, lay and picture of each frame."""
    hidden = HiddenRig.drawn(np.random.default_rng(seed))
    lay = DrivenLay(case, hidden)
    shown = GrowingLay(lay.view())
    renderer, rng = Renderer(CameraConfig()), np.random.default_rng(seed)
    for sample in range(samples):
        angle, feed = DRIVE.positions(1.0e-3 * sample)
        carriage = guide(angle, feed)
        lay.advance(angle, carriage, pulled(angle, case.weight))
        if sample % period:
            continue
        scene = shown.at(carriage, lay.view()).scene(case, angle)
        picture = partial(renderer.render, scene, rng)
        yield 1.0e-3 * sample, encoder(angle), carriage, lay, picture


def deviations(tracker, lay):
    """Return errors of theta and z of the landed markers, in their stated deviations."""
    landed = np.flatnonzero(np.isfinite(lay.marker_theta))[1:]
    assert landed.size >= 3
    found = tracker.estimates()[landed]
    assert not (found["flags"] & MarkerFlag.NOT_WOUND).any()
    off_theta = (found["theta"] - lay.marker_theta[landed]) / found["sigma_theta"]
    off_z = (found["z"] - lay.z_at(lay.marker_theta[landed])) / found["sigma_z"]
    return np.concatenate([off_theta, off_z])


@pytest.mark.parametrize(("number", "seed"), [(4, 11), (9, 12)])
def test_a_driven_lay_is_measured_within_the_stated_deviations(paper_film, number, seed):
    tracker = paper_film(number).tracker()
    for t, reading, carriage, lay, picture in driven(paper_case(number), seed, swaying):  # noqa: B007
        tracker.track(picture(), t, reading, carriage)
    # Of 16 numbers with normal errors one is beyond 4 deviations once in a thousand tests.
    assert np.abs(deviations(tracker, lay)).max() < 4.0


def taken_up(film, number, seed, since, *length):
    """Return the deviations of a tracker that joins a run of a leading guide at a time [s]."""
    case, before, tracker = paper_case(number), [], None
    guide = partial(leading, FREE_LENGTH / case.centreline_radius)
    for t, reading, carriage, lay, picture in driven(case, seed, guide, *length):  # noqa: B007
        if t < since:
            before.append((t, reading, carriage))
            continue
        tracker = tracker or film.tracker(motion_before=np.transpose(before))
        tracker.track(picture(), t, reading, carriage)
    return deviations(tracker, lay)


@pytest.mark.parametrize(("number", "seed", "since"), [(4, 11, 8.0), (1, 13, 6.0), (12, 14, 11.0)])
def test_a_tracker_that_takes_up_a_driven_run_numbers_its_markers(paper_film, number, seed, since):
    # Two passes of P0 show its colour, a third its place, two more those of the others.
    off = taken_up(paper_film(number), number, seed, since, 30_001)
    assert np.abs(off).max() < 4.0


@pytest.mark.parametrize("since", [0.5, 0.9])
def test_a_tracker_that_begins_anew_knows_the_way_of_the_guide(paper_film, since):
    # P0 has hardly been seen when the tracker begins: it is proven, and the pose turned, as it
    # passes again, and what was measured before is void.
    assert np.abs(taken_up(paper_film(4), 4, 11, since, 13_001, 20)).max() < 4.0
