"""One axis under commands: it follows targets or a trajectory within its limits."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from winding_core.machine.commands import AXES, AxisTarget, Interpolation, Motion

_CLOSING_RATE = 40.0  # Rate at which the setpoint closes up to what is wanted [1/s]
# Far from its target an axis brakes with this share of its acceleration; the rest is reserve.
_BRAKING_SHARE = 0.8
# Targets that come further apart are moves of their own, not the samples of one motion [s].
_STREAM_INTERVAL = 0.1
# A sample is carried on for this many intervals: the next one may be late, or be missing.
_OVERDUE = 2.5
# What is left of the way when a target counts as reached: the way at full speed in this time [s].
_REACHED = 1.0e-3


@dataclass(frozen=True, kw_only=True)
class MotionLimits:
    """What a commander may ask of an axis."""

    name: str  # As a sentence names it
    speed: float  # Largest speed [rad/s or m/s]
    acceleration: float  # Largest acceleration [rad/s^2 or m/s^2]
    low: float = -math.inf  # Start of its travel [rad or m]
    high: float = math.inf  # End of its travel [rad or m]

    def __post_init__(self) -> None:
        if not self.low < self.high:
            raise ValueError(
                f"the {self.name}'s travel must end above its start, "
                f"got {self.low:g} to {self.high:g} {self.unit}"
            )
        for name in ("speed", "acceleration"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be positive, got {getattr(self, name)}")

    @property
    def unit(self) -> str:
        """Unit of its way."""
        return AXES[self.name]

    def within(self, position: float) -> float:
        """Return the nearest position of the travel."""
        return min(max(position, self.low), self.high)


class Aim(Protocol):
    """What a commanded axis is after."""

    def wanted(self, t: float) -> Motion:
        """Return the motion that is asked for at t [s]."""
        ...

    def unattended(self, t: float, timeout: float, rest: float) -> bool:
        """Return whether the command that the axis still moves for was not repeated in time.

        Args:
            t: Now [s].
            timeout: How long one command holds [s].
            rest: Distance within which a position counts as reached [rad or m].
        """
        ...


@dataclass(frozen=True, kw_only=True)
class Planned:
    """A trajectory: a plan with an end, the `course`, which needs no repetition."""

    course: Interpolation

    def wanted(self, t: float) -> Motion:
        """Return the trajectory's motion at t [s]."""
        return self.course.at(t)

    def unattended(self, t: float, timeout: float, rest: float) -> bool:
        """Return False at any t [s]: it ends by itself."""
        return False


@dataclass(kw_only=True)
class Target:
    """The last of a stream of targets; between samples their rate carries on."""

    target: AxisTarget  # What was commanded
    stamp: float  # When it holds [s]
    heard: float  # When it came [s]
    rate: float = 0.0  # Change of the commanded number per second
    period: float = 0.0  # Time between samples [s]; 0 when it is no sample of a stream
    # Distance from the axis to it [rad or m]; infinite before the first control step.
    to_go: float = math.inf

    @classmethod
    def after(
        cls, last: Aim, target: AxisTarget, *, stamp: float, now: float, limits: MotionLimits
    ) -> Target:
        """Return the sample that follows the axis's last aim, of time `stamp`, come `now` [s]."""
        aim = cls(target=target, stamp=stamp, heard=now)
        if not isinstance(last, Target) or target.moves_to != last.target.moves_to:
            return aim
        interval = stamp - last.stamp
        if not 0.0 <= interval <= _STREAM_INTERVAL:
            return aim
        # Clocks tick coarsely: two samples of one tick have one rate.
        rate = (target.number - last.target.number) / interval if interval else last.rate
        largest = limits.speed if target.moves_to else limits.acceleration
        if target.moves_to and target.speed is not None:
            rate = target.speed
        # A step is no stream, and a commanded standstill has no rate.
        if abs(rate) <= largest and (target.moves_to or target.number):
            aim.rate, aim.period = rate, interval or last.period
        return aim

    def wanted(self, t: float) -> Motion:
        """Return the target at t [s], carried on while the next one may still come."""
        going_on = t - self.heard <= _OVERDUE * self.period
        rate = self.rate if going_on else 0.0
        number = self.target.number + rate * (t - self.stamp)
        if self.target.moves_to:
            return Motion(position=number, speed=rate)
        return Motion(position=None, speed=number)

    def unattended(self, t: float, timeout: float, rest: float) -> bool:
        """Return whether its stream has stopped while the axis is on its way at t [s]."""
        if t - self.heard <= timeout:
            return False
        # A speed beside a position is the rate of that position, which has not ended.
        return bool(self.target.speed) or (self.target.moves_to and self.to_go > rest)


HOLD = AxisTarget(speed=0.0)


class CommandedAxis:
    """Setpoint of an axis that a commander drives.

    Args:
        limits: What may be asked of it.
        position: Where it is taken over [rad or m].
        speed: Its speed then [rad/s or m/s].
    """

    def __init__(self, limits: MotionLimits, position: float, speed: float) -> None:
        self.limits = limits
        self.position = position  # Setpoint [rad or m]
        self.speed = speed  # Its rate [rad/s or m/s]
        self.acceleration = 0.0  # The rate of that [rad/s^2 or m/s^2]
        self.aim: Aim = Target(target=HOLD, stamp=0.0, heard=0.0)  # What it is after
        # Whether a commanded speed leads out of its travel, so that it has to brake.
        self.at_end = False

    def advance(self, t: float, dt: float) -> None:
        """Move the setpoint from t [s] on by dt [s], towards what is wanted at t."""
        limits = self.limits
        wanted = self.aim.wanted(t)
        goal = wanted.speed
        if wanted.position is not None:
            to_go = limits.within(wanted.position) - self.position
            goal += _closing_speed(to_go, limits.acceleration)
            if isinstance(self.aim, Target):
                self.aim.to_go = abs(self.aim.target.number - self.position)
        goal = min(max(goal, -limits.speed), limits.speed)
        allowed = min(
            max(goal, -_braking_speed(self.position - limits.low, limits.acceleration)),
            _braking_speed(limits.high - self.position, limits.acceleration),
        )
        self.at_end = wanted.position is None and allowed != goal
        self._change(allowed, limits.acceleration, dt)

    def brake(self, deceleration: float, dt: float) -> None:
        """Move the setpoint on by dt [s] while it comes to rest."""
        self._change(0.0, deceleration, dt)

    def unattended(self, t: float, timeout: float) -> bool:
        """Return whether commands have stopped coming for longer than `timeout` [s] in motion."""
        return self.aim.unattended(t, timeout, _REACHED * self.limits.speed)

    def _change(self, goal: float, acceleration: float, dt: float) -> None:
        most = acceleration * dt
        speed = self.speed + min(max(goal - self.speed, -most), most)
        self.acceleration = (speed - self.speed) / dt
        self.position += 0.5 * dt * (self.speed + speed)
        self.speed = speed


def _closing_speed(to_go: float, acceleration: float) -> float:
    """Return the speed at which an axis closes up: proportional when near, braking when far."""
    braking = _BRAKING_SHARE * acceleration
    near = braking / _CLOSING_RATE**2
    if abs(to_go) <= near:
        return _CLOSING_RATE * to_go
    return math.copysign(math.sqrt(2.0 * braking * (abs(to_go) - 0.5 * near)), to_go)


def _braking_speed(room: float, acceleration: float) -> float:
    """Return the largest speed from which an axis stands within some room [rad or m]."""
    return math.sqrt(2.0 * _BRAKING_SHARE * acceleration * max(room, 0.0))
