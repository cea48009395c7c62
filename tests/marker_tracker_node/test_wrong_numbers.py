"""Wrong numbers are named by the pictures and taken out of what is published; right ones stay."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from marker_film import UNSEEN, Film, FilmMaker, Frames, Wrong

from marker_tracker_node import Tracker
from marker_tracker_node.tracking.estimator.contradictions import Contradiction
from winding_core.cable.cases import paper_case
from winding_core.markers import MarkerFlag, Markers
from winding_rig_node.camera import CameraConfig, Light, SensorNoise
from winding_verification.tracker.filmed_runs import Outcome, outcome
from winding_verification.tracker.scenes import World, WrongNumber

FPS = 40.0


def darker(frame: np.ndarray, t: float) -> np.ndarray:
    return (frame * math.exp(-0.07 * t)).astype(np.uint8)


def other_hue(frame: np.ndarray, t: float) -> np.ndarray:
    hsv = cv2.cvtColor(frame, cv2.COLOR_BGR2HSV)
    hsv[..., 0] = (hsv[..., 0] + int(2.5 * t)) % 180
    return np.asarray(cv2.cvtColor(hsv, cv2.COLOR_HSV2BGR))


LIES = {
    "encoder 2.4 % short": Wrong(number="encoder_scale", share=-0.024, reading=0.976),
    "encoder 0.6 % long": Wrong(number="encoder_scale", share=0.006, reading=1.006),
    "frames timed 8 % long": Wrong(number="frame_times", share=0.08, times=1.08),
    "frames timed 7 % short": Wrong(number="frame_times", share=-0.07, times=0.93),
    "clock drifts 0.8 %": Wrong(number="frame_times", share=0.008, times=1.008),
    "cylinder 3 % thin": Wrong(
        number="cylinder_diameter", share=-0.03, config={"cylinder_radius": 0.97}
    ),
    "cylinder 4 % thick": Wrong(
        number="cylinder_diameter", share=0.04, config={"cylinder_radius": 1.04}
    ),
    "cable 14 % thick": Wrong(number="cable_diameter", share=0.14, config={"cable_radius": 1.14}),
    "focal length 4 % short": Wrong(number="focal_length", share=-0.04, focal=0.96),
    "focal length 6 % long": Wrong(number="focal_length", share=0.06, focal=1.06),
    "spacing doubled": Wrong(number="marker_spacing", config={"marker_spacing": 2.0}),
    "spacing halved": Wrong(number="marker_spacing", share=-0.5, config={"marker_spacing": 0.5}),
    "fading light": Wrong(number="light", picture=darker),
    "drifting hue": Wrong(number="marker_colour", picture=other_hue),
}
# A turn up or down is taken out by P0 at rest, before anything is measured.
TURNED_UP = "camera turned up"
CORRECTED = {
    "camera turned about its axis": Wrong(tilt=(0.0, 0.0, 0.02)),
    TURNED_UP: Wrong(tilt=(0.012, 0.0, 0.0)),
    "camera too far": Wrong(away=8.0e-3),
    "focal length 3 % short": Wrong(focal=0.97),
    "cylinder 3 % thick": Wrong(config={"cylinder_radius": 1.03}),
    "encoder 1 % short": Wrong(reading=0.99),
    "encoder 1.5 % long": Wrong(reading=1.015),
}
RIGHT = Wrong(number="")


def found_wrong(film: Film, frames: Frames, wrong: Wrong) -> tuple[Contradiction, ...]:
    """Track pictures of a film with wrong numbers and return what was found to be wrong."""
    return wrong.followed(film, frames)[0].report().contradictions


def require_named(found: tuple[Contradiction, ...], wrong: Wrong, least: float) -> None:
    """Hold that one number is named, and its share within a fifth or the least error."""
    assert [wrong.number in item.names for item in found] == [True] * bool(wrong.number)
    if found and not math.isnan(wrong.share) and found[0].number == wrong.number:
        assert found[0].share == pytest.approx(wrong.share, abs=max(least, 0.2 * abs(wrong.share)))


def off(found: Markers, truth: Markers) -> np.ndarray:
    """Return by how many deviations theta and z of P1 and later differ, shape (2, markers)."""
    names = (("theta", "sigma_theta"), ("z", "sigma_z"))
    return np.abs([(found[a] - truth[a])[1:] / found[b][1:] for a, b in names])


@pytest.fixture(scope="module")
def right(filmed: tuple[Film, Frames]) -> tuple[Tracker, list[Markers]]:
    """The tracker of a film with right numbers, and what was published."""
    return RIGHT.followed(*filmed, explain=True)


@pytest.mark.slow
@pytest.mark.parametrize("name", CORRECTED)
def test_a_wrong_number_leaves_the_markers_where_they_are(
    filmed: tuple[Film, Frames], right: tuple[Tracker, list[Markers]], name: str
) -> None:
    tracker, published = CORRECTED[name].followed(*filmed, explain=True)
    truth, found = right[0].estimates(), tracker.estimates()
    assert not (found["flags"] & int(MarkerFlag.NOT_WOUND)).any()
    assert off(found, truth).max() < 1.5
    corrected = any(text.startswith("positions are corrected") for text in tracker.report().remarks)
    assert corrected == (name != TURNED_UP)
    # One frame has more of what the mask has wrong than a run: up to 3 deviations.
    assert np.nanmax(off(published[-1], truth)) < 3.0


@pytest.mark.slow
@pytest.mark.parametrize("name", LIES)
def test_the_wrong_number_is_named(filmed: tuple[Film, Frames], name: str) -> None:
    # Seen only until the bands are lost, a share is known to the usual error of their motion.
    require_named(found_wrong(*filmed, LIES[name]), LIES[name], 0.012)


@pytest.mark.slow
@pytest.mark.parametrize(
    "wrong",
    [
        Wrong(number="cable_diameter", share=0.17, config={"cable_radius": 1.17}),
        Wrong(number="cable_diameter", share=-0.145, config={"cable_radius": 0.855}),
        Wrong(number="focal_length", share=0.04, focal=1.04),
        Wrong(number="marker_spacing", config={"marker_spacing": 0.5}),
        RIGHT,
    ],
)
def test_a_run_of_one_turn_names_the_right_number(paper_film: FilmMaker, wrong: Wrong) -> None:
    film = paper_film(4)
    # 5 s end just as P0 comes back; P1 is the only marker beside it.
    frames = [(t, frame) for t, frame, *_ in film.frames(25.0, stop=5.0)]
    # The area of a thick cable is cut at what counts as whole: three points of seventeen.
    require_named(found_wrong(film, frames, wrong), wrong, 0.03)


@pytest.mark.campaign
@pytest.mark.parametrize("case", [2, 5, 9, 10, 12])
def test_nine_of_ten_are_named_whatever_is_wound(paper_film: FilmMaker, case: int) -> None:
    film = paper_film(case)
    frames = [(t, frame) for t, frame, *_ in film.frames(FPS)]
    named = {
        name: {number for item in found_wrong(film, frames, one) for number in item.names}
        for name, one in LIES.items()
    }
    right = [one.number in named[name] for name, one in LIES.items()]
    assert sum(right) >= 0.9 * len(right), named


@pytest.mark.slow
@pytest.mark.parametrize("case", [1, 4, 7, 10])
def test_a_run_of_the_paper_raises_nothing(paper_film: FilmMaker, case: int) -> None:
    film = paper_film(case)
    frames = [(t, frame) for t, frame, *_ in film.frames(FPS)]
    assert found_wrong(film, frames, RIGHT) == ()


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(20))
def test_good_runs_raise_nothing(paper_film: FilmMaker, smooth_film: FilmMaker, seed: int) -> None:
    rng = np.random.default_rng(100 + seed)
    camera = replace(
        CameraConfig(),
        noise=SensorNoise(read=float(rng.uniform(0.0, 6.0))),
        light=Light(gain=float(rng.uniform(0.6, 1.6)), highlight=float(rng.uniform(0.0, 0.4))),
        defocus=float(rng.choice([0.0, 1.0, 1.5])),
        bayer=bool(rng.integers(0, 2)),
    )
    number, fps = int(rng.integers(1, 13)), float(rng.choice([30, 50]))
    case = paper_case(number)
    if seed % 2:
        stretch = 1.0 + case.nominal_stress / case.material.young
        film = smooth_film(number, stretch, camera=camera, seed=seed)
    else:
        film = paper_film(number, camera=camera, seed=seed)
    frames = [(t, frame) for t, frame, *_ in film.frames(fps)]
    found = found_wrong(film, frames, RIGHT)
    assert found == (), (number, camera)


def steps(published: list[Markers]) -> tuple[float, float]:
    """Return the largest step between frames of what was seen, and the way of P1, in sigma."""
    largest, way = 0.0, []
    for before, after in itertools.pairwise(published):
        known = ((before["flags"] | after["flags"]) & UNSEEN) == 0
        known[0] = False
        for name, sigma in (("theta", "sigma_theta"), ("z", "sigma_z")):
            step = np.abs(after[name] - before[name]) / np.maximum(before[sigma], after[sigma])
            largest = max(largest, float(step[known].max(initial=0.0)))
        if known[1]:
            way.append(after["z"][1] / before["sigma_z"][1])
    return largest, abs(way[-1] - way[0])


@pytest.mark.slow
def test_published_values_go_over_to_corrected_ones_without_a_jump(
    filmed: tuple[Film, Frames], right: tuple[Tracker, list[Markers]]
) -> None:
    largest, way = steps(Wrong(focal=0.97).followed(*filmed, explain=True)[1])
    assert way > 5.0
    assert largest <= steps(right[1])[0]


@pytest.mark.slow
def test_a_camera_corrected_within_its_doubt_is_healthy(filmed: tuple[Film, Frames]) -> None:
    tracker, _ = Wrong(tilt=(0.0, 0.0, 0.008)).followed(*filmed, explain=True)
    report = tracker.report()
    assert [item.number for item in report.contradictions] == ["camera_roll"]
    assert report.healthy


@pytest.mark.slow
def test_right_numbers_are_not_corrected(right: tuple[Tracker, list[Markers]]) -> None:
    tracker, _ = right
    assert tracker.report().remarks == ()
    np.testing.assert_array_equal(tracker.lens.k, tracker.camera.k)


def run(seed: int, number: str, size: float) -> tuple[World, Outcome]:
    """Return a drawn run, and what comes of a film of it with a wrong number."""
    wrong = WrongNumber(number=number, size=size)
    world = replace(World.drawn(seed), landing=wrong.landing())
    return world, outcome(world, world.frames(seed), seed, wrong)


@pytest.mark.parametrize(
    ("seed", "number", "size"),
    [
        # What is named and not corrected counts in the deviations.
        (1105, "focal_length", 0.01),
        (1106, "focal_length", -0.01),
        # The last turn covers P2 as soon as it is known, and 8 % of the focal length move it
        # 2.3 mm: a known marker without sightings is corrected with the others.
        (1105, "focal_length", 0.08),
        # Markers that were not judged: health claims nothing of them.
        (4102, "frame_times", -0.06),
        (4102, "encoder_scale", -0.06),
        (6002, "camera_roll", 0.01),
        # P1 of a thick cable is held off by its first turn to where twice the feed would have it.
        (7212, "guide_scale", 1.0),
        # P1 lies before P0 and comes first, one gap or one lap from where each is expected.
        (7305, "guide_offset", -0.02),
    ],
)
def test_what_is_reported_healthy_is_not_far_off(seed: int, number: str, size: float) -> None:
    _, found = run(seed, number, size)
    assert found.right
    # Required of what is published, of single frames and of run means.
    assert found.strayed < 5.0
    assert found.far < 5.0


@pytest.mark.parametrize(
    ("seed", "number", "size"),
    [(1105, "guide_offset", 0.009), (1106, "guide_scale", -0.15), (1106, "marker_spacing", -0.3)],
)
def test_what_no_marker_rests_on_is_named_harmless(seed: int, number: str, size: float) -> None:
    _, found = run(seed, number, size)
    assert number in found.named
    assert found.healthy
    assert found.far < 5.0  # required


@pytest.mark.parametrize(
    ("seed", "number", "size"),
    [
        (4106, "camera_height", 0.02),
        (6004, "camera_tilt_y", -0.02),
        # P0 passes four times as far from its place as it is sought.
        (1104, "camera_along", 0.02),
    ],
)
def test_a_camera_looking_elsewhere_is_no_encoder_zero(seed: int, number: str, size: float) -> None:
    _, found = run(seed, number, size)
    assert found.right or "P0 was not found where it should lie" in found.sentences
    assert found.known == 0
    assert not found.healthy


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("seed", "number", "size"),
    [
        # Later turns leave P0 in sight for 0.4 rad of each lap, and it comes round beside its
        # place.
        (1001, "encoder_scale", -0.02),
        (1001, "encoder_scale", 0.06),
        (1001, "encoder_scale", -0.06),
        (1001, "frame_times", -0.06),
        (1001, "camera_clock", -0.24),
        # One lap lies between the markers: those that a turn of a late pass made forgotten, sought
        # anew in the third, changed places.
        (1021, "guide_offset", 0.009),
    ],
)
def test_every_marker_is_found_though_p0_comes_late(seed: int, number: str, size: float) -> None:
    world, found = run(seed, number, size)
    assert found.known == (world.markers[0] < world.position(world.duration)[0]).sum()
    assert found.far < (1.5 if seed == 1001 else 5.0)  # required
    assert found.right or seed == 1021


@pytest.mark.campaign
@pytest.mark.parametrize(("seed", "offset"), [(7310, -0.014), (7312, -0.009)])
def test_a_cable_that_is_led_over_p0_is_not_published_as_healthy(seed: int, offset: float) -> None:
    # P1 hides half of P0, or is one band with it.
    _, found = run(seed, "guide_offset", offset)
    assert not found.healthy
    assert found.strayed < 5.0  # required
