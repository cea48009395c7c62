"""The way on which the simulated machine's arm carries the guide, and what forbids it."""

import math
from pathlib import Path

import numpy as np

from winding_core.arm.arm_file import ArmMapping
from winding_core.arm.joint import ArmError, Joint
from winding_core.arm.kinematics import LOOK, NEAR, Arm
from winding_core.arm.rigid import FloatArray, Pose
from winding_core.units import MILLIMETRE

# Points of a link whose distance from the cylinder is looked at.
_LINK_POINTS = np.linspace(0.0, 1.0, 9)[:, None]
_MARGIN = 0.02  # The cylinder goes on beyond the ends of a way by so much [m]
# A solved joint position is as near as this to the one before [rad or m]: it is on the same branch.
_BRANCH = 1.0


class ArmPath:
    """Where the arm's joints stand with the eye on its way, its tool turned as at home.

    The eye keeps the tangent plane x = R + r of `winder_axis`; its distance before the contact line
    is the free length, one number or a function of the way along the axis.

    Args:
        mapping: Of the arm.
        radius: Of the centre line of cable on the cylinder [m].
        free_length: Where the file gives none [m].

    Raises:
        ArmError: The description cannot be used, or the arm does not reach the start.
    """

    def __init__(self, mapping: ArmMapping, radius: float, free_length: float) -> None:
        guide, path = mapping.guide, mapping.path
        self.arm = Arm(Path(guide.urdf), guide.base, guide.tip)  # Its kinematics
        names = [joint.name for joint in self.arm.joints]
        if len(path.home_rad) != len(names):
            raise ArmError(
                f"home_rad of path needs a position for each of {', '.join(names)}, got "
                f"{len(path.home_rad)}"
            )
        self.mapping = mapping
        self._axis = mapping.winder_axis.pose
        self._seen = self._axis.inverse()
        self._eye = np.array(guide.eye_m, dtype=float)
        self._radius, self._free_length = radius, free_length
        home = np.array(path.home_rad, dtype=float)
        self._turn = self.arm.tip(home).rotation
        # Joint positions with the eye beside P0 [rad or m], shape (joints,).
        self.start = self.arm.solved(self.tip_at(0.0), home)

    @property
    def base(self) -> Pose:
        """The arm's base in `winder_axis`."""
        return self._seen

    @property
    def guide(self) -> Pose:
        """The eye in the tip, its axes those of `winder_axis` while the tool is turned as it is."""
        return Pose(position=self._eye, rotation=self._turn.T @ self._axis.rotation)

    @property
    def varies(self) -> bool:
        """Whether the free length changes along the way."""
        return len(set(self.mapping.path.span_m)) > 1

    def span_at(self, along: float) -> float:
        """Return the free length [m] with the eye at a place along the axis [m]."""
        path = self.mapping.path
        if not path.span_m:
            return self._free_length
        return float(np.interp(along, path.along_m, path.span_m))

    def tip_at(self, along: float) -> Pose:
        """Return the tip in the base with the eye at a place along the axis [m]."""
        eye = self._axis.point([self._radius, -self.span_at(along), along])
        return Pose(position=eye - self._turn @ self._eye, rotation=self._turn)

    def eye(self, joints: FloatArray) -> FloatArray:
        """Return where the eye stands in `winder_axis` at joint positions [m], shape (3,)."""
        return self._seen.point(self.arm.tip(joints).point(self._eye))

    def slopes(self, joints: FloatArray) -> FloatArray:
        """Return how the eye moves in `winder_axis` with the joints, shape (3, joints)."""
        moved = self.arm.jacobian(joints)
        turn = self._seen.rotation @ self.arm.tip(joints).rotation
        return np.asarray(turn @ (moved[:3] + np.cross(moved[3:].T, self._eye).T))

    def direction(self, along: float) -> FloatArray:
        """Return the way of the eye in the base for a metre along the axis, shape (3,)."""
        step = 1.0e-4
        spans = self.span_at(along + step) - self.span_at(along - step)
        return np.asarray(self._axis.rotation @ [0.0, -0.5 * spans / step, 1.0])

    def fastest(self, along: float, joints: FloatArray) -> tuple[float, Joint]:
        """Return how fast the guide may go along the axis [m/s], and which joint limits it."""
        return self.arm.fastest(joints, self.direction(along))

    def links(self, joints: FloatArray) -> FloatArray:
        """Return base, joints and eye in `winder_axis` [m], shape (joints + 2, 3)."""
        placed = self.arm.links(joints)
        placed[-1] = self.arm.tip(joints).point(self._eye)
        return np.array([self._seen.point(point) for point in placed])

    def reach(self, end: float) -> tuple[float, str]:
        """Return how far the guide gets from the start towards a place [m], and why no further."""
        return self.arm.reach(self.tip_at, self.start, 0.0, end)

    def joints_at(self, along: float, near: FloatArray, within: float = NEAR) -> FloatArray:
        """Return joint positions with the eye at a place, from those near by.

        Args:
            along: The place along the axis [m].
            near: Joint positions [rad or m], shape (joints,).
            within: Distance and turn that are left at most [m], [rad].

        Raises:
            ArmError: The arm does not reach it.
        """
        found = self.arm.solved(self.tip_at(along), near, within)
        if np.abs(found - near).max() > _BRANCH:
            raise ArmError(f"the arm would have to turn over to lead the guide to {along:.4g} m")
        return found

    def check(self, low: float, high: float, speed: float, cylinder_radius: float) -> None:
        """Refuse a way of the guide that the arm cannot go.

        Args:
            low: Where it begins along the axis, not above 0 [m].
            high: Where it ends, not below 0 [m].
            speed: Largest speed of the guide on it [m/s].
            cylinder_radius: Of the bare cylinder [m].

        Raises:
            ArmError: Travel, reach, joint speeds or the cylinder forbid it: where, and which.
        """
        commands = self.mapping.commands
        for end in (low, high):
            if not commands.low_m <= end <= commands.high_m:
                raise ArmError(
                    f"the guide would go to {end:.4g} m, beyond its travel of {commands.low_m:.4g} "
                    f"to {commands.high_m:.4g} m"
                )
        if speed > commands.speed_m_s:
            raise ArmError(
                f"the guide would go at {speed:.4g} m/s, its largest speed is "
                f"{commands.speed_m_s:.4g} m/s"
            )
        for end in (low, high):
            joints = self.start
            count = max(2, math.ceil(abs(end) / LOOK) + 1)
            for along in np.linspace(0.0, end, count).tolist():
                joints = self.joints_at(along, joints)
                self._check_at(along, joints, speed)
                self._check_clearance(along, joints, (low, high), cylinder_radius)

    def _check_at(self, along: float, joints: FloatArray, speed: float) -> None:
        allowed, joint = self.fastest(along, joints)
        if allowed < speed:
            raise ArmError(
                f"at {along:.4g} m the guide would go at {speed:.4g} m/s, {joint.name} allows "
                f"{allowed:.3g} m/s there, as near a singularity"
            )

    def _check_clearance(
        self, along: float, joints: FloatArray, ends: tuple[float, float], cylinder_radius: float
    ) -> None:
        near, clearance = self._distance(joints, *ends), self.mapping.path.clearance_m
        if near < cylinder_radius + clearance:
            raise ArmError(
                f"with the guide at {along:.4g} m the arm comes as near as "
                f"{(near - cylinder_radius) / MILLIMETRE:.0f} mm to the cylinder, its clearance is "
                f"{clearance / MILLIMETRE:.0f} mm"
            )

    def _distance(self, joints: FloatArray, low: float, high: float) -> float:
        """Return how near the links come to the axis between two places on it [m]."""
        placed = self.links(joints)
        points = placed[:-1, None] + _LINK_POINTS * (placed[1:] - placed[:-1])[:, None]
        beside = (points[..., 2] > low - _MARGIN) & (points[..., 2] < high + _MARGIN)
        off = np.hypot(points[..., 0], points[..., 1])
        return float(off[beside].min(initial=math.inf))
