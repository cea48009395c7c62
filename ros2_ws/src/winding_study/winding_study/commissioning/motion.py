"""Motions that a machine can make within its limits, of which one commissions the cell."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.winding.rig_prior import RigPrior
from winding_core.cable.cases import Case
from winding_core.machine.drive import DriveProfile
from winding_core.parameters import ParameterError
from winding_core.run_inputs import Inputs, planned_inputs

LONGEST = 60.0  # Machine time of a commissioning run [s]
_FEWEST_TURNS = 2.0  # A motion shorter than this many turns has wound no marker twice round
# A change of the pull takes at least so long a way [rad]: a brake's time constant, twice.
_STEP_WAY = 0.8
_FULL_TURN = 2.0 * math.pi
# Bending's share of the tension, and stress over E, up to which the rod winds well
# (docs/measurements/identification.md).
MOST_BENT, MOST_STRESSED = 0.2, 0.45


@dataclass(frozen=True, kw_only=True)
class MachineReach:
    """What the machine may do."""

    # Smallest and largest cylinder speed [rad/s]; equal where it is the machine's own.
    speeds: tuple[float, float]
    carriage_speed: float  # Largest speed of the carriage [m/s]
    # Speed of the carriage where that is the machine's own [m/s]; None: it is chosen.
    feed: float | None = None
    travel: float  # Greatest way of the carriage [m], towards the side of the feed
    clear: float = 0.0  # Least advance of the guide per turn with which no turn lies on another [m]
    weight: float  # Pull without a command [N]
    # Smallest and largest pull that may be commanded [N]; None: the weight alone pulls.
    pulls: tuple[float, float] | None = None
    ramp_time: float  # From standstill to full speed [s]
    longest: float = LONGEST  # Longest motion [s]

    def __post_init__(self) -> None:
        low, high = self.speeds
        for name, value in (
            ("the cylinder speed", low),
            ("the carriage's speed limit", self.carriage_speed),
            ("the carriage's travel", self.travel),
            ("the weight", self.weight),
        ):
            if not (math.isfinite(value) and value > 0.0):
                raise ParameterError(f"{name} must be positive for a motion, got {value:g}")
        if not low <= high < math.inf:
            raise ParameterError(f"cylinder speeds must ascend, got {low:g} to {high:g} rad/s")
        if not 0.0 < self.longest <= LONGEST:
            raise ParameterError(
                f"a commissioning run takes at most {LONGEST:g} s, got {self.longest:g} s"
            )
        if self.pulls is not None and not 0.0 < self.pulls[0] < self.pulls[1] < math.inf:
            raise ParameterError(
                f"pulls must ascend from above 0, got {self.pulls[0]:g} to {self.pulls[1]:g} N"
            )


@dataclass(frozen=True, kw_only=True)
class Motion:
    """One motion of a machine."""

    name: str  # Of the pull's course
    drive: DriveProfile  # Of both axes
    duration: float  # [s]
    # Cylinder angles of the pull's corners [rad], ascending from 0.
    angles: tuple[float, ...] = (0.0,)
    # The pull there [N], straight lines between, the weight's at 0; one alone is not commanded.
    pulls: tuple[float, ...]

    @property
    def commands_pull(self) -> bool:
        """Whether the pull is commanded; otherwise the weight pulls."""
        return len(self.pulls) > 1

    @property
    def end_angle(self) -> float:
        """Cylinder angle at the end [rad]."""
        return float(self.drive.positions(self.duration)[0])

    def pull_at(self, angle: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the pull [N] at cylinder angles [rad], same shape."""
        return np.asarray(np.interp(angle, self.angles, self.pulls))

    @property
    def commanded(self) -> Callable[[NDArray[np.float64]], NDArray[np.float64]] | None:
        """Commanded pull [N] at cylinder angles [rad], as a tracked run takes it; None: none is."""
        return self.pull_at if self.commands_pull else None

    def inputs(self) -> Inputs:
        """Return the motion as inputs of a model; their tension is the pull at the guide."""
        inputs = planned_inputs(self.drive, self.duration)
        inputs["tension"] = self.pull_at(inputs["cylinder_angle"])
        return inputs

    @property
    def sentence(self) -> str:
        """What moves how, in words."""
        drive = self.drive
        pull = (
            f"pull {self.name}, {min(self.pulls):.3g} to {max(self.pulls):.3g} N"
            if self.commands_pull
            else f"pull {self.pulls[0]:.3g} N throughout"
        )
        return (
            f"{self.duration:.1f} s at {drive.angular_speed:.3g} rad/s "
            f"({self.end_angle / _FULL_TURN:.1f} turns), feed {1e3 * drive.feed_speed:.3g} mm/s, "
            f"{pull}"
        )


def candidates(reach: MachineReach, sign: float = 1.0) -> Iterator[Motion]:
    """Yield motions within the limits of a machine.

    Args:
        reach: The limits.
        sign: Of the feed, 1 or -1, dimensionless.

    Raises:
        ParameterError: The limits allow no motion of two turns.
    """
    none = True
    for speed in sorted({*reach.speeds}):
        for feed in _feeds(reach, speed):
            drive = DriveProfile(
                angular_speed=speed, feed_speed=math.copysign(feed, sign), ramp_time=reach.ramp_time
            )
            duration = min(reach.longest, reach.travel / feed + 0.5 * reach.ramp_time)
            end = float(drive.positions(duration)[0])
            if end < _FEWEST_TURNS * _FULL_TURN:
                continue
            none = False
            for name, angles, pulls in _pulls(reach, end):
                yield Motion(name=name, drive=drive, duration=duration, angles=angles, pulls=pulls)
    if none:
        raise ParameterError(
            f"the limits allow no motion of {_FEWEST_TURNS:g} turns: {reach.longest:g} s at up to "
            f"{reach.speeds[1]:g} rad/s, {1e3 * reach.travel:g} mm of travel, the carriage at up "
            f"to {1e3 * reach.carriage_speed:g} mm/s, {1e3 * reach.clear:.3g} mm a turn at least"
        )


def safe_pulls(
    case: Case, prior: RigPrior, pulls: tuple[float, float]
) -> tuple[float, float] | None:
    """Return the part of a range of pulls [N] in which the solver holds, in the prior's middle.

    None where that is empty: the weight alone pulls.
    """
    share, drag = (0.5 * sum(ends) for ends in (prior.load_share, prior.guide_drag))
    least = case.bending_stiffness / (2.0 * MOST_BENT * case.centreline_radius**2)
    most = MOST_STRESSED * case.material.young * case.axial_area
    low = max(pulls[0], (least - drag) / share)
    high = min(pulls[1], (most - drag) / share)
    return (low, high) if low < high else None


def clearing_advance(diameter: float, lag: float) -> float:
    """Return the advance of the guide per turn [m] from which on the first turn clears P0's.

    By the lag law cable lies p (1 - (1 - exp(-2 pi / lag)) lag / (2 pi)) beside P0 after one turn.

    Args:
        diameter: Of the cable [m].
        lag: Free length over centreline radius [rad].
    """
    turns = lag / _FULL_TURN
    return diameter / (1.0 + turns * math.expm1(-1.0 / turns))


def _feeds(reach: MachineReach, speed: float) -> Iterator[float]:
    if reach.feed is not None:
        yield abs(reach.feed)
        return
    # As slow as fills the time with the travel, and faster ones that leave less time.
    slowest = max(reach.travel / reach.longest, reach.clear * speed / _FULL_TURN)
    for factor in (1.0, 1.5, 2.0, 3.0):
        feed = factor * slowest
        if feed <= reach.carriage_speed:
            yield feed


def _pulls(
    reach: MachineReach, end: float
) -> Iterator[tuple[str, tuple[float, ...], tuple[float, ...]]]:
    yield "even", (0.0,), (reach.weight,)
    if reach.pulls is None:
        return
    low, high = reach.pulls
    weight, middle = reach.weight, math.sqrt(low * high)
    # Corners: share of the whole angle, and the pull there; before the first the weight pulls. A
    # step makes cable slip and tells friction, a slow way every stretch of the law between.
    courses = {
        "low, then high": ((0.0, low), (0.5, low), (0.5, high)),
        "high, then low": ((0.0, high), (0.5, high), (0.5, low)),
        "in three steps up": (
            (0.0, low), (1 / 3, low), (1 / 3, middle), (2 / 3, middle), (2 / 3, high),
        ),
        "in three steps down": (
            (0.0, high), (1 / 3, high), (1 / 3, middle), (2 / 3, middle), (2 / 3, low),
        ),
        "rising": ((0.0, low), (1.0, high)),
        "falling": ((0.0, high), (1.0, low)),
        "rising late, then low": ((0.4, weight), (0.8, high), (0.8, low)),
        "rising late, then the weight's": ((0.3, weight), (0.3, low), (0.8, high), (0.8, weight)),
        "falling late, then high": ((0.3, weight), (0.3, high), (0.8, low), (0.8, high)),
        "falling late, then the weight's": ((0.3, weight), (0.3, high), (0.8, low), (0.8, weight)),
        "rising, low and rising": ((0.0, low), (0.5, high), (0.5, low), (1.0, high)),
    }  # fmt: skip
    for name, corners in courses.items():
        angles, pulls = [0.0], [weight]
        for share, pull in corners:
            # A step begins where the corner before it is.
            angles.append(max(share * end, angles[-1] + _STEP_WAY))
            pulls.append(pull)
        if angles[-1] < end:
            angles.append(end)
            pulls.append(pulls[-1])
        yield name, tuple(angles), tuple(pulls)
