"""The paper's runs measured back, and precision, recall and identity under disturbances."""

import math
from dataclasses import replace

import numpy as np
import pytest
from marker_film import FULL_VIEW, UNSEEN, dark_where, photograph

from winding_core.markers import MarkerFlag
from winding_rig_node.camera import Light, Paint, Patch, SensorNoise, Surroundings

pytestmark = [pytest.mark.campaign, pytest.mark.slow]


# The live rate is 200 frames/s; the other cases are filmed more coarsely to save time, which
# gives the tracker less to go on, not more.
@pytest.mark.parametrize(
    ("case", "fps"), [(4, 200.0), *((n, 30.0) for n in range(1, 13) if n != 4)]
)
def test_every_measured_length_comes_back_within_two_thousandths(paper_film, case, fps):
    film = paper_film(case)
    tracker, records, _ = film.followed(fps)
    known = ~np.isnan(film.theta)

    estimates = tracker.estimates()
    error = np.abs(estimates["s"] - film.s)[known][1:] / film.s[known][1:]
    assert error.max() <= 0.002  # the specification's bar

    measured = (records["flags"] & UNSEEN) == 0
    for n in np.flatnonzero(known)[1:]:
        seen = records["s"][measured[:, n], n]
        assert seen.size > 0
        assert np.abs(seen - film.s[n]).max() / film.s[n] <= 0.002


@pytest.mark.parametrize("case", [2, 7, 8])
def test_a_marker_that_never_lands_stays_not_wound(paper_film, case):
    _, records, _ = paper_film(case).followed(40.0)
    assert ((records["flags"][:, 4] & MarkerFlag.NOT_WOUND) != 0).all()
    assert np.isnan(records["theta"][:, 4]).all()


def test_nothing_is_valid_before_it_lies_on_the_cylinder(paper_film):
    film = paper_film(4)
    _, records, angles = film.followed(60.0, stop=9.0)
    wound = (records["flags"] & MarkerFlag.NOT_WOUND) == 0
    assert wound.any()
    # A marker is measured to 0.2 % of S, 12 mrad here; that early it may be called landed.
    assert (np.where(wound, film.theta - angles[:, None], 0.0) <= 0.012).all()


YELLOW = (25.0, 185.0, 225.0)
# A published number is right when it is closer to its own marker than anything it could be
# confused with: neighbouring markers lie 6 rad and 9 mm away.
RIGHT_THETA, RIGHT_Z = 0.05, 1.0e-3


def require(film, records, angles, recall=0.0):
    """Hold that nothing false is published; return recall over markers within 60 degrees.

    Args:
        film: That was tracked.
        records: Of its frames.
        angles: Of the cylinder [rad].
        recall: Least share that must be found.
    """
    valid = (records["flags"] & UNSEEN) == 0
    right = (
        valid
        & (np.abs(records["theta"] - film.theta) < RIGHT_THETA)
        & (np.abs(records["z"] - film.z) < RIGHT_Z)
    )
    azimuth = angles[:, None] - film.theta
    facing = np.abs((azimuth + math.pi) % (2.0 * math.pi) - math.pi) < math.radians(60.0)
    due = facing & (azimuth >= 0.0)
    assert right.sum() == valid.sum() > 0
    found = (right & due).sum() / due.sum()
    assert found >= recall
    return found


DECOYS = tuple(
    Patch(column=column, row=row, width=90, height=70, colour=colour)
    for column, row, colour in (
        (300, 150, YELLOW),
        (700, 170, (20, 120, 240)),
        (1200, 900, YELLOW),
        (1500, 160, (25, 60, 120)),
        (500, 930, (10, 150, 200)),
    )
)
STICKER = (Patch(column=700, row=540, width=50, height=50, colour=YELLOW, in_front=True),)
BRASS = Paint(cylinder=(70.0, 150.0, 180.0))

DISTURBANCES = {
    "plain": {},
    "light x0.5": {"camera": replace(FULL_VIEW, light=Light(gain=0.5))},
    "light x2": {"camera": replace(FULL_VIEW, light=Light(gain=2.0))},
    "flicker x0.5 to x2": {"camera": replace(FULL_VIEW, light=Light(flicker=1.0))},
    "noise of 8 grey levels": {"camera": replace(FULL_VIEW, noise=SensorNoise(read=8.0))},
    "Bayer": {"camera": replace(FULL_VIEW, bayer=True)},
    "highlight": {"camera": replace(FULL_VIEW, light=Light(highlight=0.6))},
    "defocus": {"camera": replace(FULL_VIEW, defocus=2.0)},
    "yellow decoys": {"surroundings": Surroundings(patches=DECOYS)},
    "a sticker where cable will lie": {"surroundings": Surroundings(patches=STICKER)},
    "a brass cylinder": {"paint": BRASS},
    "brass, decoys, Bayer, noise, flicker": {
        "camera": replace(
            FULL_VIEW, bayer=True, noise=SensorNoise(read=8.0), light=Light(gain=0.7, flicker=0.3)
        ),
        "surroundings": Surroundings(patches=DECOYS),
        "paint": BRASS,
    },
}


@pytest.mark.parametrize("name", DISTURBANCES)
def test_nothing_false_and_little_missed(paper_film, name):
    film = paper_film(9, **{"camera": FULL_VIEW, **DISTURBANCES[name]})
    tracker, records, angles = film.followed(24.0)
    require(film, records, angles, 0.98)
    assert tracker.report().known == 5
    assert tracker.report().contradictions == ()


GLARES = {
    # Recall was 0.38, 0.36 and 0.66 when white pixels counted as background.
    "wide": Light(highlight=1.0, gloss=2.0),
    "wide, overexposed": Light(highlight=1.0, gloss=4.0, gain=1.5),
    "from the side": Light(highlight=1.0, gloss=6.0, direction=(1.0, -1.0, 0.1)),
    "along the axis": Light(highlight=1.0, gloss=24.0, direction=(1.0, 0.2, 0.8)),
    **{
        f"random {seed}": Light(
            highlight=float(dice.uniform(0.7, 1.0)),
            gloss=float(dice.uniform(2.0, 30.0)),
            gain=float(dice.uniform(0.5, 1.4)),
            direction=(1.0, float(dice.uniform(-1.0, 1.0)), float(dice.uniform(-0.8, 0.8))),
        )
        for seed, dice in ((seed, np.random.default_rng(seed)) for seed in range(12))
    },
}


@pytest.mark.parametrize("name", GLARES)
def test_a_strong_highlight_hides_a_part_and_not_the_band(paper_film, name):
    film = paper_film(9, camera=replace(FULL_VIEW, light=GLARES[name]))
    _, records, angles = film.followed(24.0)
    require(film, records, angles, 0.9)


def test_several_highlights_hide_parts_and_not_the_band(paper_film):
    film = paper_film(9, camera=FULL_VIEW)
    rows = np.arange(FULL_VIEW.window.shape[0])[:, None, None]
    lamps = sum(np.exp(-(((rows - middle) / 9.0) ** 2)) for middle in (110, 150, 185, 230))

    def shining(frame, angle):
        lit = frame + 255.0 * lamps * (frame.max(axis=2, keepdims=True) > 100)
        return np.minimum(lit, 255).astype(np.uint8)

    _, records, angles = film.followed(24.0, change=shining)
    require(film, records, angles, 0.9)


@pytest.mark.parametrize("name", ["china.jpg", "flower.jpg"])
def test_a_photograph_behind_the_cylinder_does_not_matter(paper_film, name):
    film = paper_film(9, camera=FULL_VIEW, surroundings=Surroundings(photograph=photograph(name)))
    tracker, records, angles = film.followed(24.0)
    require(film, records, angles, 0.98)
    assert tracker.report().contradictions == ()


def test_four_of_five_frames_may_be_missing(paper_film):
    film = paper_film(9, camera=FULL_VIEW)
    tracker, records, angles = film.followed(100.0, missing=0.8)
    require(film, records, angles, 0.98)
    assert tracker.report().contradictions == ()


def test_a_marker_hidden_on_arrival_is_found_a_turn_later_under_its_own_number(paper_film):
    film = paper_film(9)
    second = film.theta[2]
    # Nothing can be seen from before P2 lands until it has left the picture.
    dark = dark_where(lambda angle: second - 0.6 < angle < second + 1.2)
    tracker, records, angles = film.followed(50.0, change=dark)
    require(film, records, angles)
    assert tracker.report().known == 5
    valid = (records["flags"][:, 2] & UNSEEN) == 0
    assert angles[valid].min() > second + 4.0
    assert tracker.report().contradictions == ()
    estimate = tracker.estimates()
    # The bar of 0.2 % of S holds for a marker that was recovered, too.
    np.testing.assert_allclose(estimate["s"], film.s, rtol=0.002, atol=1e-4)


def test_a_rod_across_the_cylinder_costs_frames_but_no_truth(paper_film):
    rod = Patch(column=960, row=640, width=1920, height=26, colour=(60, 60, 60), in_front=True)
    film = paper_film(9, camera=FULL_VIEW, surroundings=Surroundings(patches=(rod,)))
    tracker, records, angles = film.followed(24.0)
    assert tracker.report().contradictions == ()
    # A covered band is reported as covered, not guessed.
    assert require(film, records, angles) < 0.98
    covered = (records["flags"] & MarkerFlag.OCCLUDED) != 0
    assert covered.sum() > 0
    assert (records["flags"][covered] & MarkerFlag.PREDICTED != 0).all()


def test_a_marker_that_creeps_is_followed_and_flagged(smooth_film):
    film = smooth_film(9)
    tracker = film.tracker()
    creep, seen = 5.0e-3, []
    start = film.theta[1] / 1.74 + 0.5
    true = film.theta.copy()
    for t, _, angle, guide in film.frames(50.0):
        now = true.copy()
        now[1] += creep * max(t - start, 0.0)
        film.theta = now
        truth = film.scene(angle, guide, marker_theta=now)
        frame = film.renderer.render(truth, film.rng)
        records = tracker.track(frame, t, angle, guide)
        if (records["flags"][1] & UNSEEN) == 0:
            seen.append((t, records["theta"][1] - now[1], records["flags"][1]))
    errors = np.array([error for _, error, _ in seen])
    # Three times the single-frame deviation at this resolution.
    assert np.abs(errors).max() < 6.0e-3
    slipped = [t for t, _, flags in seen if flags & MarkerFlag.SLIPPED]
    # 30 mrad of slip at 5 mrad/s take 6 s; the flag follows at the next sight of the marker.
    assert start + 5.0 < min(slipped) < start + 12.0
    assert records["flags"][3] & MarkerFlag.SLIPPED == 0
