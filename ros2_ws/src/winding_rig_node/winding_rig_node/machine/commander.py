"""Takes commands for the axes and the brake, or refuses them in one sentence."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from winding_core.machine.commanded_axis import (
    HOLD,
    Aim,
    CommandedAxis,
    MotionLimits,
    Planned,
    Target,
)
from winding_core.machine.commands import (
    CARRIAGE,
    CYLINDER,
    Command,
    Interpolation,
    JointTargets,
    JointTrajectory,
    TensionCommand,
    Waypoint,
)

# Speed at which a trajectory's end still counts as standing, as a share of the axis's limit.
_STANDING = 1.0e-6
_ROUNDING = 1.0 + 1.0e-9  # Interpolation may exceed a limit that its points keep by rounding alone


CYLINDER_LIMITS = MotionLimits(name=CYLINDER, speed=8.0, acceleration=10.0)
CARRIAGE_LIMITS = MotionLimits(name=CARRIAGE, speed=0.08, acceleration=0.5, low=-0.1, high=1.0)


class CommandError(ValueError):
    """The machine cannot execute a command; nothing has changed."""


@dataclass(frozen=True, kw_only=True)
class CommandLimits:
    """What a commander may ask of the machine."""

    cylinder: MotionLimits = CYLINDER_LIMITS  # Its axis
    carriage: MotionLimits = CARRIAGE_LIMITS  # Its axis
    low_tension: float = 0.1  # Smallest pull of the brake [N]
    high_tension: float = 20.0  # Its largest pull [N]
    brake_time: float = 0.2  # Time constant of the brake [s]
    # How long a target holds that is not reached yet, and how old one may be [s].
    timeout: float = 0.5

    def __post_init__(self) -> None:
        if not self.low_tension < self.high_tension:
            raise ValueError(
                f"the brake's largest pull must exceed its smallest, "
                f"got {self.low_tension:g} to {self.high_tension:g} N"
            )


@dataclass(kw_only=True)
class Brake:
    """A brake of first order: its `pull` [N] follows what is `wanted` [N]."""

    pull: float
    wanted: float

    def advance(self, time_constant: float, dt: float) -> None:
        """Move on by dt [s]."""
        self.pull -= (self.wanted - self.pull) * math.expm1(-dt / time_constant)


class Commander:
    """What commanders have asked for since the last start."""

    def __init__(self, limits: CommandLimits) -> None:
        self.limits = limits
        # Axes that are under commands, by name; the others follow the drive programme.
        self.axes: dict[str, CommandedAxis] = {}
        # The brake, once it was commanded; before that a dead weight pulls.
        self.brake: Brake | None = None
        self.refused = 0  # Count of refused commands
        self.refusal = ""  # Why the last one was refused; empty when the last one was taken
        self._limits = {item.name: item for item in (limits.cylinder, limits.carriage)}

    def take(
        self, command: Command, now: float, standing: Mapping[str, CommandedAxis], pull: float
    ) -> None:
        """Execute a command from now on.

        Args:
            command: The command.
            now: The machine's time [s].
            standing: Both axes as they would be taken over, by name.
            pull: Present pull on the cable [N].

        Raises:
            CommandError: It asks for what the machine cannot do.
        """
        if isinstance(command, TensionCommand):
            self._check_age(command.t, now)
            self._check_tension(command.force)
            self.brake = self.brake or Brake(pull=pull, wanted=pull)
            self.brake.wanted = command.force
        else:
            present = {**standing, **self.axes}
            for name in command.axes:
                self._check_place(present[name])
            if isinstance(command, JointTargets):
                aims = self._targets(command, now, present)
            else:
                aims = self._courses(command, now, present)
            for name, aim in aims.items():
                self.axes[name] = present[name]
                self.axes[name].aim = aim
        self.refusal = ""

    def refuse(self, reason: str) -> None:
        """Count a command that was refused."""
        self.refused += 1
        self.refusal = reason

    def release(self) -> None:
        """Give the axes back to the drive programme; the brake stays."""
        self.axes.clear()

    def halt(self) -> None:
        """Stop every setpoint at once: the drives are cut."""
        for axis in self.axes.values():
            axis.speed = axis.acceleration = 0.0

    def verdict(self, t: float) -> str:
        """Return why the axes have to be stopped at t [s], or nothing."""
        for name, axis in self.axes.items():
            unit = axis.limits.unit
            if axis.unattended(t, self.limits.timeout):
                return (
                    f"no command for the {name} for more than {self.limits.timeout:g} s "
                    f"while it moves at {axis.speed:.3g} {unit}/s"
                )
            if axis.at_end:
                end = axis.limits.high if axis.speed > 0.0 else axis.limits.low
                return (
                    f"the {name} at {axis.position:.4g} {unit} and {axis.speed:.3g} {unit}/s has "
                    f"to stop before the end of its travel at {end:g} {unit}"
                )
        return ""

    @property
    def standing(self) -> bool:
        """Whether no setpoint of an axis under commands moves."""
        return all(axis.speed == 0.0 for axis in self.axes.values())

    def _targets(
        self, command: JointTargets, now: float, present: Mapping[str, CommandedAxis]
    ) -> dict[str, Aim]:
        self._check_age(command.t, now)
        aims: dict[str, Aim] = {}
        for name, target in command.axes.items():
            limits, last = self._limits[name], present[name].aim
            stamp = command.t or now
            if isinstance(last, Target) and stamp < last.stamp:
                raise CommandError(
                    f"a command for the {name} must not be older than the one before it at "
                    f"{last.stamp:.3f} s, it is of {stamp:.3f} s"
                )
            if target.position is not None:
                self._check_reach(limits, target.position)
            if target.speed is not None and abs(target.speed) > limits.speed:
                raise CommandError(
                    f"{name} speed must be at most {limits.speed:g} {limits.unit}/s, "
                    f"got {target.speed:g}"
                )
            aims[name] = Target.after(last, target, stamp=stamp, now=now, limits=limits)
        return aims

    def _courses(
        self, command: JointTrajectory, now: float, present: Mapping[str, CommandedAxis]
    ) -> dict[str, Aim]:
        begin = command.t or now
        # A new trajectory replaces the old one, also for an axis that it does not name.
        aims: dict[str, Aim] = {
            name: Target(target=HOLD, stamp=now, heard=now)
            for name, axis in self.axes.items()
            if isinstance(axis.aim, Planned)
        }
        for name, points in command.axes.items():
            aims[name] = Target(target=HOLD, stamp=now, heard=now)
            if points:
                aims[name] = Planned(course=self._course(present[name], begin, points, now))
        return aims

    def _course(
        self, axis: CommandedAxis, begin: float, points: tuple[Waypoint, ...], now: float
    ) -> Interpolation:
        limits = axis.limits
        name, unit = limits.name, limits.unit
        ahead = tuple(
            Waypoint(t=begin + point.t, position=point.position, speed=point.speed)
            for point in points
            if begin + point.t > now
        )
        if not ahead:
            raise CommandError(
                f"the {name} trajectory must end after now, {now:.3f} s, "
                f"it ends at {begin + points[-1].t:.3f} s"
            )
        if abs(ahead[-1].speed or 0.0) > _STANDING * limits.speed:
            raise CommandError(
                f"the {name} trajectory must end at rest, it ends at {ahead[-1].speed:g} {unit}/s"
            )
        course = Interpolation((Waypoint(t=now, position=axis.position, speed=axis.speed), *ahead))
        for position in course.reach():
            self._check_reach(limits, position)
        for (most, moment), limit, rate in (
            (course.fastest(), limits.speed, "/s"),
            (course.hardest(), limits.acceleration, "/s^2"),
        ):
            if most > limit * _ROUNDING:
                raise CommandError(
                    f"the {name} trajectory must stay within {limit:g} {unit}{rate}, it asks for "
                    f"{most:.3g} at {moment - now:.3f} s from now"
                )
        return course

    def _check_place(self, axis: CommandedAxis) -> None:
        limits = axis.limits
        if axis.position != limits.within(axis.position):
            raise CommandError(
                f"the {limits.name} must stand within its travel of {limits.low:g} to "
                f"{limits.high:g} {limits.unit} to be commanded, it is at {axis.position:.4g}"
            )

    def _check_reach(self, limits: MotionLimits, position: float) -> None:
        if not limits.low <= position <= limits.high:
            raise CommandError(
                f"{limits.name} position must lie in {limits.low:g} to {limits.high:g} "
                f"{limits.unit}, got {position:g}"
            )

    def _check_tension(self, force: float) -> None:
        low, high = self.limits.low_tension, self.limits.high_tension
        if not low <= force <= high:
            raise CommandError(f"tension must lie in {low:g} to {high:g} N, got {force:g}")

    def _check_age(self, stamp: float, now: float) -> None:
        """Refuse a stamp by another clock than the machine's; 0 stands for now."""
        if stamp and abs(stamp - now) > self.limits.timeout:
            raise CommandError(
                f"a command must be stamped within {self.limits.timeout:g} s of the machine's "
                f"time, {now:.3f} s, it is of {stamp:.3f} s"
            )
