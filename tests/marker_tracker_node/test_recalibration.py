"""What the sightings show of wrong numbers is taken out of what is published."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from marker_film import UNSEEN, Film, Frames, Wrong

from marker_tracker_node import Tracker
from winding_core.markers import MarkerFlag, Markers
from winding_verification.tracker.filmed_runs import outcome
from winding_verification.tracker.scenes import World, WrongNumber

WRONG = {
    "camera turned about its axis": Wrong(tilt=(0.0, 0.0, 0.02)),
    "camera turned up": Wrong(tilt=(0.012, 0.0, 0.0)),
    "camera too far": Wrong(away=8.0e-3),
    "focal length 3 % short": Wrong(focal=0.97),
    "cylinder 3 % thick": Wrong(config={"cylinder_radius": 1.03}),
    "encoder 1 % short": Wrong(reading=0.99),
    "encoder 1.5 % long": Wrong(reading=1.015),
}


def followed(filmed: tuple[Film, Frames], wrong: Wrong) -> tuple[Tracker, list[Markers]]:
    """Return the tracker of a film, explaining it as it goes, and what was published."""
    return wrong.followed(*filmed, explain=True)


def off(found: Markers, truth: Markers) -> np.ndarray:
    """Return by how many deviations theta and z of P1 and later differ, shape (2, markers)."""
    names = (("theta", "sigma_theta"), ("z", "sigma_z"))
    return np.abs([(found[a] - truth[a])[1:] / found[b][1:] for a, b in names])


@pytest.mark.slow
@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_number_leaves_the_markers_where_they_are(
    filmed: tuple[Film, Frames], name: str
) -> None:
    right, _ = followed(filmed, Wrong())
    tracker, published = followed(filmed, WRONG[name])
    truth, found = right.estimates(), tracker.estimates()
    assert not (found["flags"] & int(MarkerFlag.NOT_WOUND)).any()
    assert off(found, truth).max() < 1.5
    # A turn up or down is taken out by P0 at rest, before anything is measured.
    corrected = any(text.startswith("positions are corrected") for text in tracker.report().remarks)
    assert corrected == (name != "camera turned up")
    # One frame has more of what the mask has wrong than a run: up to 3 deviations.
    assert np.nanmax(off(published[-1], truth)) < 3.0


@pytest.fixture(scope="module")
def covered() -> tuple[World, list[np.ndarray]]:
    """Return a run in which later turns leave P0 in sight for 0.4 rad of each lap."""
    world = World.drawn(1001)
    return world, world.frames(1001)


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("number", "size"),
    [
        ("encoder_scale", -0.02),
        ("encoder_scale", 0.06),
        ("encoder_scale", -0.06),
        ("frame_times", -0.06),
        ("camera_clock", -0.24),
    ],
)
def test_a_p0_that_comes_round_beside_its_place_is_found(
    covered: tuple[World, list[np.ndarray]], number: str, size: float
) -> None:
    world, frames = covered
    found = outcome(world, frames, 1001, WrongNumber(number=number, size=size))
    assert found.right
    assert found.known == world.marker_count
    assert found.far < 1.5  # required


@pytest.mark.campaign
def test_a_turn_that_a_late_pass_gives_forgets_no_marker() -> None:
    # One lap lies between the markers: sought anew in the third, they changed places.
    wrong = WrongNumber(number="guide_offset", size=0.009)
    world = replace(World.drawn(1021), landing=wrong.landing())
    found = outcome(world, world.frames(1021), 1021, wrong)
    assert found.known == len(world.markers[0])
    assert found.far < 5.0  # required


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
    filmed: tuple[Film, Frames],
) -> None:
    right, _ = steps(followed(filmed, Wrong())[1])
    largest, way = steps(followed(filmed, WRONG["focal length 3 % short"])[1])
    assert way > 5.0
    assert largest <= right


@pytest.mark.slow
def test_a_run_whose_camera_is_corrected_within_its_doubt_is_healthy(
    filmed: tuple[Film, Frames],
) -> None:
    tracker, _ = followed(filmed, Wrong(tilt=(0.0, 0.0, 0.008)))
    report = tracker.report()
    assert [item.number for item in report.contradictions] == ["camera_roll"]
    assert report.healthy


@pytest.mark.slow
def test_right_numbers_are_not_corrected(filmed: tuple[Film, Frames]) -> None:
    tracker, _ = followed(filmed, Wrong())
    assert tracker.report().remarks == ()
    np.testing.assert_array_equal(tracker.lens.k, tracker.camera.k)


@pytest.mark.parametrize(("seed", "size"), [(1105, 0.01), (1106, -0.01)])
def test_what_is_named_and_not_corrected_counts_in_the_deviations(seed: int, size: float) -> None:
    world = World.drawn(seed)
    run = outcome(world, world.frames(seed), seed, WrongNumber(number="focal_length", size=size))
    assert run.right
    # What is reported healthy is not farther off.
    assert run.far < 5.0


@pytest.mark.parametrize(
    ("seed", "number", "size"),
    [(1105, "guide_offset", 0.009), (1106, "guide_scale", -0.15), (1106, "marker_spacing", -0.3)],
)
def test_what_no_marker_rests_on_is_named_and_leaves_the_run_healthy(
    seed: int, number: str, size: float
) -> None:
    wrong = WrongNumber(number=number, size=size)
    world = replace(World.drawn(seed), landing=wrong.landing())
    run = outcome(world, world.frames(seed), seed, wrong)
    assert number in run.named
    assert run.healthy
    assert run.far < 5.0  # required


def test_a_known_marker_without_sightings_is_corrected_with_the_others() -> None:
    # The last turn covers P2 as soon as it is known, and 8 % of the focal length move it 2.3 mm.
    wrong = WrongNumber(number="focal_length", size=0.08)
    world = World.drawn(1105)
    run = outcome(world, world.frames(1105), 1105, wrong)
    assert run.right
    assert run.far < 5.0  # required


@pytest.mark.parametrize(
    ("seed", "number", "size"),
    [(4102, "frame_times", -0.06), (4102, "encoder_scale", -0.06), (6002, "camera_roll", 0.01)],
)
def test_health_claims_nothing_of_markers_that_were_not_judged(
    seed: int, number: str, size: float
) -> None:
    world = World.drawn(seed)
    run = outcome(world, world.frames(seed), seed, WrongNumber(number=number, size=size))
    assert run.right
    assert run.strayed < 5.0  # required


@pytest.mark.parametrize(
    ("seed", "number", "size"),
    [(4106, "camera_height", 0.02), (6004, "camera_tilt_y", -0.02)],
)
def test_a_camera_that_looks_elsewhere_is_no_zero_of_the_encoder(
    seed: int, number: str, size: float
) -> None:
    world = World.drawn(seed)
    run = outcome(world, world.frames(seed), seed, WrongNumber(number=number, size=size))
    assert run.right
    assert run.known == 0


def test_a_p0_that_is_never_found_is_reported() -> None:
    # It passes four times as far from its place as it is sought.
    wrong = WrongNumber(number="camera_along", size=0.02)
    world = World.drawn(1104)
    run = outcome(world, world.frames(1104), 1104, wrong)
    assert run.known == 0
    assert not run.healthy
    assert "P0 was not found where it should lie" in run.sentences
