"""How a machine's joints become the axes of a run, and whether they move as expected."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, replace
from statistics import fmean

from winding_core.machine.drive import DriveProfile
from winding_core.machine.readings import AxisReading, GuidePlace
from winding_core.parameters import parameter
from winding_core.units import PLAIN

# A speed is the slope of positions at least so far apart [s]: an encoder's step over a shorter
# time would be noise. A little less than the period of a driver at 100 Hz.
_SLOPE_PERIOD = 0.0099


@dataclass(frozen=True, kw_only=True)
class MachineAxes:
    """Joint names, and position of an axis = scale (joint position - offset).

    The simulated machine, and a driver that reports radians and metres from the start of the run
    in the direction of winding, need none of it. `winding run` sets the offsets of a real machine
    to where its joints stand before the start.
    """

    cylinder_joint: str = parameter("cylinder_joint", "name of the cylinder's joint", PLAIN)
    carriage_joint: str = parameter("carriage_joint", "name of the carriage's joint", PLAIN)
    cylinder_scale: float = parameter(
        1.0, "radians of the cylinder per unit of its joint; negative where it counts backwards",
        PLAIN, -1.0e6, 1.0e6,
    )  # fmt: skip
    carriage_scale: float = parameter(
        1.0, "metres of the carriage per unit of its joint; negative where it counts backwards",
        PLAIN, -1.0e6, 1.0e6,
    )  # fmt: skip
    cylinder_offset: float = parameter(
        0.0,
        "joint position at which the cylinder's angle is 0, in the joint's unit",
        low=-1.0e9,
        high=1.0e9,
    )
    carriage_offset: float = parameter(
        0.0,
        "joint position at which the carriage's way is 0, in the joint's unit",
        low=-1.0e9,
        high=1.0e9,
    )
    carriage_speed: float = parameter(
        0.0,
        "largest speed of the carriage [m/s], where more than the drive programme moves it; 0 for "
        "the feed speed",
        low=0.0,
        high=2.0,
    )
    await_motion: bool = parameter(
        False, "whether a run begins with the machine's first motion instead of its first reading"
    )

    def __post_init__(self) -> None:
        if self.cylinder_joint == self.carriage_joint:
            raise ValueError(f"cylinder and carriage must be two joints, got {self.cylinder_joint}")
        for name, scale in (("cylinder", self.cylinder_scale), ("carriage", self.carriage_scale)):
            if scale == 0.0:
                raise ValueError(f"{name}_scale must not be 0")

    def positions(self, cylinder: float, carriage: float) -> tuple[float, float]:
        """Return (angle [rad], carriage position [m]) of two joint positions."""
        return (
            self.cylinder_scale * (cylinder - self.cylinder_offset),
            self.carriage_scale * (carriage - self.carriage_offset),
        )

    def speeds(self, cylinder: float, carriage: float) -> tuple[float, float]:
        """Return (angular speed [rad/s], feed speed [m/s]) of two joint speeds."""
        return self.cylinder_scale * cylinder, self.carriage_scale * carriage

    def standing_at(self, positions: Iterable[tuple[float, float]]) -> MachineAxes:
        """Return axes whose offsets are the mean of joint positions, at least one pair."""
        cylinder, carriage = zip(*positions, strict=True)
        return replace(self, cylinder_offset=fmean(cylinder), carriage_offset=fmean(carriage))


@dataclass(frozen=True, kw_only=True)
class JointSample:
    """Both joints at one instant, in their own units."""

    t: float  # [s]
    cylinder: float  # Position of the cylinder's joint.
    carriage: float  # Position of the carriage's joint.
    cylinder_speed: float = math.nan  # nan where the driver reports none.
    carriage_speed: float = math.nan  # nan where the driver reports none.
    guide: GuidePlace | None = None  # None where the machine reports none.


class AxisReader:
    """Makes readings of joint samples; speeds that are not reported are slopes of positions.

    A slope is that of the parabola through the newest position and two earlier ones, so it is
    exact while the machine accelerates evenly.
    """

    def __init__(self, axes: MachineAxes) -> None:
        self.axes = axes
        self._past: deque[tuple[float, float, float]] = deque()

    def read(self, sample: JointSample) -> AxisReading:
        """Return the reading of a sample; one older than the last gives speeds of zero."""
        angle, position = self.axes.positions(sample.cylinder, sample.carriage)
        angular, feed = self.axes.speeds(sample.cylinder_speed, sample.carriage_speed)
        if math.isnan(angular) or math.isnan(feed):
            slopes = self._slopes(sample.t, angle, position)
            angular = slopes[0] if math.isnan(angular) else angular
            feed = slopes[1] if math.isnan(feed) else feed
        return AxisReading(
            cylinder_angle=angle,
            angular_speed=angular,
            carriage_position=position,
            feed_speed=feed,
            guide=sample.guide,
        )

    def _slopes(self, t: float, angle: float, position: float) -> tuple[float, float]:
        past = self._past
        if past and t <= past[-1][0]:
            past.clear()
        # The two that are kept in front are the newest at least one and two periods old.
        while len(past) > 2 and t - past[1][0] >= 2.0 * _SLOPE_PERIOD:
            past.popleft()
        earlier = [row for row in past if t - row[0] >= _SLOPE_PERIOD]
        past.append((t, angle, position))
        if not earlier:
            return 0.0, 0.0
        near, far = earlier[-1], earlier[0]
        return tuple(  # type: ignore[return-value]
            _slope((t, now), (near[0], near[k]), (far[0], far[k]))
            for k, now in ((1, angle), (2, position))
        )


def _slope(now: tuple[float, float], near: tuple[float, float], far: tuple[float, float]) -> float:
    """Return the slope at `now` of the parabola through three points (t, x), or of the chord."""
    chord = (now[1] - near[1]) / (now[0] - near[0])
    if far[0] >= near[0]:
        return chord
    before = (near[1] - far[1]) / (near[0] - far[0])
    curvature = (chord - before) / (now[0] - far[0])
    return chord + curvature * (now[0] - near[0])


_DECISIVE = (0.15, 5.0e-4)  # A way that decides, of the cylinder [rad] and of the carriage [m]
# Another machine's speeds are its own business; another unit is further off than this.
_FACTOR = 5.0


def wrong_axis(reading: AxisReading, elapsed: float, drive: DriveProfile, lead: float = 0.0) -> str:
    """Return what is wrong with the axes of a machine that has just begun to wind, or nothing.

    Args:
        reading: Both axes, from where the machine stood.
        elapsed: Time since the first motion [s].
        drive: How the axes are expected to move.
        lead: Way by which a controlled carriage goes ahead of the cable besides [m].
    """
    angle, way = reading.cylinder_angle, reading.carriage_position
    expected_angle, expected_way = drive.positions(elapsed)
    slow = _FACTOR * max(abs(float(expected_way)), abs(float(expected_way) + lead))
    if abs(way) > max(_DECISIVE[0], slow) and abs(angle) < max(slow, _DECISIVE[1]):
        return (
            f"cylinder and carriage are swapped: the carriage moved {way:.3g} m while the cylinder "
            f"turned {angle:.3g} rad; exchange cylinder_joint and carriage_joint"
        )
    if angle < -_DECISIVE[0]:
        return (
            f"the cylinder turned backwards, by {angle:.3g} rad: its joint counts the other way "
            "(a negative cylinder_scale) or the machine unwinds"
        )
    if drive.feed_speed * way < 0.0 and lead * way <= 0.0 and abs(way) > _DECISIVE[1]:
        towards = "-z" if way < 0.0 else "+z"
        return (
            f"the carriage moved backwards, by {way:.3g} m: its joint counts the other way "
            f"(a negative carriage_scale) or the machine winds towards {towards}"
        )
    if angle > _DECISIVE[0] and angle > _FACTOR * float(expected_angle):
        return (
            f"the cylinder turned {angle:.3g} rad where {float(expected_angle):.3g} rad were "
            "expected: cylinder_scale must give radians"
        )
    if drive.feed_speed != 0.0 and abs(way) > max(_DECISIVE[1], slow):
        return (
            f"the carriage moved {way:.3g} m where {float(expected_way) + lead:.3g} m were "
            "expected: "
            "carriage_scale must give metres"
        )
    return ""
