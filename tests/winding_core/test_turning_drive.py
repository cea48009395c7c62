"""A drive whose guide turns back and which unwinds: positions, speeds, limits."""

from __future__ import annotations

import numpy as np
import pytest

from winding_core.machine.drive import TurningDrive

DRIVES = (
    TurningDrive(guide_turns_at=0.02),
    TurningDrive(unwinds_from=5.0),
    TurningDrive(guide_turns_at=-0.02, feed_speed=-5.0e-3, unwinds_from=7.0),
    TurningDrive(guide_turns_at=0.0025, unwinds_from=1.0),
)


@pytest.mark.parametrize("drive", DRIVES)
def test_speeds_are_the_slopes_of_positions(drive: TurningDrive) -> None:
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


@pytest.mark.parametrize("drive", [drive for drive in DRIVES if drive.unwinds_from is not None])
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


def test_angle_beyond_the_turning_is_refused() -> None:
    with pytest.raises(ValueError, match=r"turns back at 8\.7 rad, before 9 rad"):
        TurningDrive(unwinds_from=5.0).time_at_angle(9.0)


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"guide_turns_at": -0.01}, "it never gets there"),
        ({"guide_turns_at": 0.01, "feed_speed": 0.0}, "it never gets there"),
        ({"guide_turns_at": 0.002}, "at 2.5 mm or further"),
        ({"unwinds_from": 0.5}, "from the end of the ramp at 1 s on, got 0.5 s"),
    ],
)
def test_what_no_machine_can_do_is_refused(given: dict[str, float], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        TurningDrive(**given)
