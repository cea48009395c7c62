"""How the guide is led along the axis: after a target, within its limits and those of the arm."""

import math
from dataclasses import dataclass, replace

import numpy as np

from winding_core.arm.arm_file import Commands
from winding_core.arm.joint import ArmError
from winding_core.arm.kinematics import Arm
from winding_core.arm.rigid import FloatArray, Pose
from winding_core.machine.commanded_axis import CommandedAxis, MotionLimits, Target
from winding_core.machine.commands import CARRIAGE, AxisTarget

# Rate at which a commanded velocity closes up to the setpoint [1/s]: a quarter of what a dead time
# of 50 ms would make ring.
_CLOSING_RATE = 5.0
_SLOWED = 0.98  # A guide this much slower than it may go is reported as slowed


@dataclass(frozen=True, kw_only=True)
class Led:
    """What the arm is commanded with at one instant."""

    tip: Pose  # Of the tip, in the base
    velocity: FloatArray  # Of the eye in the base [m/s], shape (3,)
    joints: FloatArray | None  # Positions [rad or m]; None without kinematics
    joint_speeds: FloatArray | None  # [rad/s or m/s]


class GuideLead:
    """Leads the guide from where it stands; it keeps its place across the axis and its turn.

    Args:
        commands: Limits of the guide.
        axis: `winder_axis` in the base.
        eye: The guide's eye in the tip's frame [m], shape (3,).
        arm: Its kinematics; None where poses or velocities are commanded.

    Attributes:
        remark: Why the guide is slower than it was asked to be, or does not go on; else empty.
        late: Whether targets have stopped while the guide was on its way.
    """

    def __init__(self, commands: Commands, axis: Pose, eye: FloatArray, arm: Arm | None) -> None:
        self._commands, self._axis, self._eye, self._arm = commands, axis, eye, arm
        self._seen = axis.inverse()
        self._limits = MotionLimits(
            name=CARRIAGE,
            speed=commands.speed_m_s,
            acceleration=commands.acceleration_m_s2,
            low=commands.low_m,
            high=commands.high_m,
        )
        self._led: CommandedAxis | None = None
        # Whether it came to rest because targets stopped; why it reaches no further, at both ends.
        self._left, self._ends = False, ("", "")
        self._heard = -math.inf
        self._place, self._tip = np.zeros(3), Pose.standing()
        self._joints: FloatArray | None = None
        self.remark, self.late = "", False

    @property
    def active(self) -> bool:
        """Whether the guide follows targets."""
        return self._led is not None and not self._left

    def aim(
        self, target: AxisTarget, stamp: float, now: float, tip: Pose, joints: FloatArray | None
    ) -> None:
        """Take a target of the guide along the axis.

        Args:
            target: Position [m] or speed [m/s].
            stamp: When it holds [s].
            now: [s]
            tip: Where the tip stands in the base; with the first target the guide is taken over.
            joints: Of the arm there [rad or m].

        Raises:
            ValueError: The target leaves the travel or the speed of the guide; nothing changes.
        """
        speed = target.speed or 0.0
        if abs(speed) > self._limits.speed:
            raise ValueError(
                f"the guide must not be faster than {self._limits.speed:.4g} m/s, got "
                f"{speed:.4g} m/s"
            )
        if self._led is None or self._left:
            self._take_over(tip, joints)
        limits, position = self._limits, target.position
        if position is not None and not limits.low <= position <= limits.high:
            end = 0 if position < limits.low else 1
            raise ValueError(
                f"the guide must stay within {limits.low:.4g} to {limits.high:.4g} m"
                f"{self._ends[end]}, got {position:.4g} m"
            )
        led = self._led or CommandedAxis(limits, float(self._place[2]), 0.0)
        led.aim = Target.after(led.aim, target, stamp=stamp, now=now, limits=limits)
        self._led, self._heard = led, now

    def _take_over(self, tip: Pose, joints: FloatArray | None) -> None:
        """Begin where the tip stands; find the travel that the arm reaches from there."""
        commands = self._commands
        self._led, self._left = None, False
        self._tip, self._joints = tip, joints
        self._place = self._seen.point(tip.point(self._eye))
        (low, lowest), (high, highest) = (
            self._reached(end, joints) for end in (commands.low_m, commands.high_m)
        )
        self._ends = lowest, highest
        self._limits = replace(self._limits, low=low, high=high)

    def _reached(self, end: float, joints: FloatArray | None) -> tuple[float, str]:
        """Return how far the guide reaches towards an end of its travel [m], and why no further."""
        if self._arm is None or joints is None:
            return end, ""
        begin = float(self._place[2])
        reached, why = self._arm.reach(self._tip_at, joints, begin, end)
        return reached, f", as {why}" if why else ""

    def advance(self, t: float, dt: float, tip: Pose, *, turning: bool = True) -> Led | None:
        """Go on from t [s] by dt [s]; return the command, None while nothing is led.

        Args:
            t: Now [s].
            dt: Since the last command [s].
            tip: Where the tip stands in the base; a commanded velocity closes up to the setpoint.
            turning: Whether the cylinder turns; otherwise the guide comes to rest, too.
        """
        led = self._led
        if led is None or self._left:
            return None
        self.late = led.unattended(t, self._commands.timeout_s)
        led.limits, self.remark = self._limits, ""
        arm, joints = self._arm, self._joints
        along = self._axis.rotation[:, 2]
        if arm is not None and joints is not None:
            led.limits = replace(self._limits, speed=self._fastest(arm, joints, along))
        before = led.position, led.speed
        silent = t - self._heard > self._commands.timeout_s
        if silent or not turning:
            led.brake(self._limits.acceleration, dt)
            self._left = led.speed == 0.0
        if self.late:
            self.remark = f"the guide stands: no target has come for {self._commands.timeout_s:g} s"
        if turning and not silent:
            led.advance(t, dt)
        if arm is not None and joints is not None:
            try:
                self._joints = arm.solved(self._tip_at(led.position), joints)
            except ArmError as error:
                led.position, led.speed = before[0], 0.0
                self.remark = f"the guide stands at {before[0]:.4g} m: {error}"
        speeds = None
        if self._joints is not None and joints is not None:
            speeds = (self._joints - joints) / dt
        ahead = led.position + led.speed * self._commands.ahead_s
        joints = self._joints
        if arm is not None and joints is not None and speeds is not None:
            joints = joints + speeds * self._commands.ahead_s
        behind = led.position - float(self._seen.point(tip.point(self._eye))[2])
        speed = min(max(led.speed + _CLOSING_RATE * behind, -led.limits.speed), led.limits.speed)
        return Led(
            tip=self._tip_at(ahead), velocity=along * speed, joints=joints, joint_speeds=speeds
        )

    def _tip_at(self, along: float) -> Pose:
        """Return the tip with the eye so far along the axis [m]."""
        eye = self._axis.point([self._place[0], self._place[1], along])
        turn = self._tip.rotation
        return Pose(position=eye - turn @ self._eye, rotation=turn)

    def _fastest(self, arm: Arm, joints: FloatArray, along: FloatArray) -> float:
        """Return the largest speed [m/s] with which no joint exceeds its own."""
        allowed, joint = arm.fastest(joints, along)
        fastest = min(self._limits.speed, allowed)
        if fastest < _SLOWED * self._limits.speed:
            self.remark = (
                f"the guide is slowed to {fastest:.3g} m/s: {joint.name} would exceed its largest "
                f"speed of {joint.speed:.3g}, as near a singularity"
            )
        return fastest
