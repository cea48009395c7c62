"""Drive programmes: positions are the integral of speeds; the inputs of a run as a file."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from winding_core.machine.drive import DriveProfile, TurningDrive
from winding_core.machine.readings import GuidePlace
from winding_core.run_inputs import RunHistory, RunInputs, RunInputsError, no_inputs

PAPER = DriveProfile()
DRIVES = (
    PAPER,
    DriveProfile(feed_speed=-3.0e-3, ramp_time=0.4),
    TurningDrive(guide_turns_at=0.02),
    TurningDrive(unwinds_from=5.0),
    TurningDrive(guide_turns_at=-0.02, feed_speed=-5.0e-3, unwinds_from=7.0),
    TurningDrive(guide_turns_at=0.0025, unwinds_from=1.0),
)


@pytest.mark.parametrize(
    ("t", "angle", "carriage"),
    [
        (-1.0, 0.0, 0.0),
        (0.0, 0.0, 0.0),
        (0.5, 0.2175, 0.000625),
        (1.0, 0.87, 0.0025),
        (5.0, 7.83, 0.0225),
        (20.0, 33.93, 0.0975),
        (21.0, 35.67, 0.1025),
    ],
)
def test_the_papers_drive_follows_its_closed_form(t: float, angle: float, carriage: float) -> None:
    assert PAPER.positions(t) == pytest.approx((angle, carriage), rel=1e-14, abs=1e-15)


def test_the_pitch_is_the_papers() -> None:
    # 5 mm/s over 1.74 rad/s for one turn, by hand.
    assert PAPER.pitch == pytest.approx(0.0180551302, rel=1e-8)


def test_speeds_ramp_linearly_and_hold() -> None:
    assert PAPER.speeds(0.25) == pytest.approx((0.435, 0.00125), rel=1e-14)
    assert PAPER.speeds(1.0) == PAPER.speeds(19.0) == (1.74, 0.005)
    assert PAPER.speeds(-1.0) == (0.0, 0.0)


def test_time_at_angle_undoes_positions() -> None:
    for t in (0.0, 0.2, 1.0, 1.0001, 18.0):
        assert PAPER.time_at_angle(PAPER.positions(t)[0]) == pytest.approx(t, rel=1e-12, abs=1e-12)


def test_arrays_and_scalars_agree() -> None:
    t = np.array([-1.0, 0.0, 0.5, 1.0, 7.0])
    assert PAPER.fraction(t).tolist() == [PAPER.fraction(x) for x in t]
    assert PAPER.full_speed_time(t).tolist() == [PAPER.full_speed_time(x) for x in t]


def test_without_a_ramp_full_speed_starts_at_once() -> None:
    sudden = DriveProfile(ramp_time=0.0)
    assert sudden.speeds(1e-9) == (1.74, 0.005)
    assert sudden.positions(2.0) == pytest.approx((3.48, 0.01))
    assert sudden.time_at_angle(3.48) == pytest.approx(2.0)


def test_a_feed_towards_minus_z_mirrors_the_carriage() -> None:
    back = DriveProfile(feed_speed=-PAPER.feed_speed)
    for t in (0.3, 1.0, 7.0):
        assert back.positions(t) == (PAPER.positions(t)[0], -PAPER.positions(t)[1])
        assert back.speeds(t) == (PAPER.speeds(t)[0], -PAPER.speeds(t)[1])


@pytest.mark.parametrize("drive", DRIVES)
def test_speeds_are_the_slopes_of_positions(drive: DriveProfile) -> None:
    t = np.linspace(0.0, 15.0, 15001)
    for position, speed in zip(drive.positions(t), drive.speeds(t), strict=True):
        way = np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(t))
        # Speeds are straight pieces; a kink within a step of 1 ms is worth 1e-6.
        np.testing.assert_allclose(position[1:], way, atol=2.0e-6)


def test_guide_turns_at_the_position() -> None:
    t = np.linspace(0.0, 10.0, 100001)
    assert TurningDrive(guide_turns_at=0.02).positions(t)[1].max() == pytest.approx(0.02, abs=1e-9)
    down = TurningDrive(guide_turns_at=-0.02, feed_speed=-5.0e-3)
    assert down.positions(t)[1].min() == pytest.approx(-0.02, abs=1.0e-9)


@pytest.mark.parametrize(
    "drive", [drive for drive in DRIVES if getattr(drive, "unwinds_from", None)]
)
def test_unwinding_retraces_the_way(drive: TurningDrive) -> None:
    assert drive.positions(drive.longest) == pytest.approx((0.0, 0.0), abs=1.0e-12)
    for angle in (0.1, 0.8):
        there = drive.positions(drive.time_at_angle(angle))
        late = np.linspace(drive.unwinds_from or 0.0, drive.longest, 200001)
        turned, guide = drive.positions(late)
        back = guide[np.abs(turned - angle).argmin()]
        assert there[0] == pytest.approx(angle, abs=1.0e-12)
        # The samples are 0.1 mrad apart, and the guide moves by 3 mm per radian.
        assert there[1] == pytest.approx(back, abs=1.0e-6)


def inputs(count: int = 5) -> RunInputs:
    samples = no_inputs(count)
    samples["t"] = np.arange(count)
    samples["cylinder_angle"] = 2.0 * samples["t"]
    samples["tension"] = [np.nan, *np.full(count - 1, 3.0)]
    return RunInputs(samples=samples)


def test_file_gives_back_what_was_written(tmp_path: Path) -> None:
    file = tmp_path / "inputs.npy"
    inputs().write(file)
    assert RunInputs.read(file).samples.tobytes() == inputs().samples.tobytes()


def test_tension_that_was_not_read_is_none() -> None:
    rows = list(inputs())
    assert [tension for _, _, tension in rows] == [None, 3.0, 3.0, 3.0, 3.0]
    assert rows[2][1].cylinder_angle == 4.0


def test_times_that_do_not_ascend_are_refused() -> None:
    with pytest.raises(RunInputsError, match="must ascend"):
        RunInputs(samples=inputs().samples[::-1])


def test_pickled_objects_are_never_loaded(tmp_path: Path) -> None:
    file = tmp_path / "inputs.npy"
    np.save(file, np.array([{"a": 1}], dtype=object), allow_pickle=True)
    with pytest.raises(RunInputsError, match="holds no inputs of a run"):
        RunInputs.read(file)


def test_place_of_the_guide_gives_span_and_landing() -> None:
    radius, free_length = 0.02, 0.2
    place = GuidePlace.beside(radius, free_length)
    assert place.free_length(radius) == pytest.approx(free_length, rel=1.0e-12)
    assert place.landing(radius) == pytest.approx(0.0, abs=1.0e-12)
    turned = GuidePlace(x=-place.y, y=place.x)
    assert turned.landing(radius) == pytest.approx(0.5 * np.pi, abs=1.0e-12)
    with pytest.raises(ValueError, match=r"more than 0.02 m off the axis, .* got 0.014"):
        GuidePlace(x=0.01, y=0.01).free_length(radius)


def test_place_of_the_guide_is_kept_with_the_inputs() -> None:
    history, place = RunHistory(), GuidePlace(x=0.02, y=-0.1)
    reading = DriveProfile().reading_at(1.0)
    history.record(0.0, reading, None)
    history.record(1.0, replace(reading, guide=place), None)
    assert [reading.guide for _, reading, _ in RunInputs(samples=history.inputs)] == [None, place]
