"""Kinematics of the arm from its URDF, by Pinocchio: where the guide is, and how it is led."""

import math
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pinocchio

from winding_core.arm.joint import SPEED_SHARE, ArmError, Joint
from winding_core.arm.rigid import FloatArray, Pose

# A step of the inverse kinematics ends when the tip is so near [m], [rad].
NEAR = 1.0e-6
_MOST_STEPS = 30
LOOK = 5.0e-3  # Places at which a way is looked at are so far apart [m]
# Damping of the least squares, beside singular values of about one: moves little where none is.
_DAMPING = 1.0e-4
# Keeps a quotient finite where a joint does not move, or its description allows no speed.
_NO_SHARE = 1.0e-9


class Arm:
    """An arm from its base to a tip; its joints are those in between, in this order.

    Args:
        urdf: File of its description.
        base: Link that poses are given in.
        tip: Link that carries the guide.

    Raises:
        ArmError: The file is no URDF, a link is missing, or a joint has more than one axis.
    """

    def __init__(self, urdf: Path, base: str, tip: str) -> None:
        try:
            self._model = pinocchio.buildModelFromXML(urdf.read_text(encoding="utf-8"))
        except (OSError, UnicodeError, ValueError, RuntimeError) as error:
            reason = " ".join(str(error).split())
            raise ArmError(f"{urdf} is no robot description: {reason}") from None
        self._data = self._model.createData()
        self._base, self._tip = self._link(base), self._link(tip)
        chain = self._chain(tip)
        behind = set(self._chain(base))
        # Those that move between base and tip.
        self.joints = tuple(self._joint(k) for k in chain if k not in behind)
        if not self.joints:
            raise ArmError(f"no joint moves {tip} in {base}")
        self._speed_limits = np.array([max(joint.speed, _NO_SHARE) for joint in self.joints])
        self._q = np.array(pinocchio.neutral(self._model))
        kept = [k for k in chain if k not in behind]
        self._kept = kept
        self._places = [self._model.joints[k].idx_q for k in kept]
        self._rates = [self._model.joints[k].idx_v for k in kept]

    def tip(self, q: FloatArray) -> Pose:
        """Return the tip in the base at joint positions [rad or m], shape (joints,)."""
        found = self._moved(q)
        return Pose(position=found.translation.copy(), rotation=found.rotation.copy())

    def links(self, q: FloatArray) -> FloatArray:
        """Return base, origins of the joints and tip in the base [m], shape (joints + 2, 3)."""
        end = self._moved(q).translation
        base = self._data.oMf[self._base]
        origins = [base.actInv(self._data.oMi[k]).translation for k in self._kept]
        return np.array([np.zeros(3), *origins, end])

    def positions(self, by_name: Mapping[str, float]) -> FloatArray:
        """Return positions by joint name in the order of the joints, shape (joints,).

        Raises:
            ArmError: One is missing.
        """
        missing = [joint.name for joint in self.joints if joint.name not in by_name]
        if missing:
            raise ArmError(f"joint states lack {', '.join(missing)} of the arm")
        return np.array([by_name[joint.name] for joint in self.joints])

    def jacobian(self, q: FloatArray) -> FloatArray:
        """Return how the tip moves and turns with the joints, in its axes, shape (6, joints)."""
        self._moved(q)
        pinocchio.computeJointJacobians(self._model, self._data, self._whole(q))
        own = pinocchio.getFrameJacobian(
            self._model, self._data, self._tip, pinocchio.ReferenceFrame.LOCAL
        )
        return np.asarray(own[:, self._rates])

    def solved(self, wanted: Pose, q: FloatArray, near: float = NEAR) -> FloatArray:
        """Return joint positions with the tip at a pose in the base, from positions near by.

        Args:
            wanted: The pose.
            q: Where the search begins, shape (joints,).
            near: Distance and turn that are left at most [m], [rad].

        Raises:
            ArmError: The pose is out of reach, or a joint's travel ends before.
        """
        aim = pinocchio.SE3(wanted.rotation, wanted.position)
        found = np.array(q, dtype=float)
        for _ in range(_MOST_STEPS):
            off = pinocchio.log6(self._moved(found).actInv(aim)).vector
            if np.abs(off).max() < near:
                break
            slopes = self.jacobian(found)
            normal = slopes.T @ slopes + _DAMPING**2 * np.eye(found.size)
            found = found + np.linalg.solve(normal, slopes.T @ off)
        else:
            where = ", ".join(f"{number:.4g}" for number in wanted.position)
            raise ArmError(f"the arm does not reach ({where}) m with its tool turned as it is")
        for joint, position in zip(self.joints, found.tolist(), strict=True):
            if not joint.low <= position <= joint.high:
                raise ArmError(
                    f"{joint.name} would go to {position:.4g}, beyond its travel of "
                    f"{joint.low:.4g} to {joint.high:.4g}"
                )
        return found

    def reach(
        self, tip_at: Callable[[float], Pose], q: FloatArray, begin: float, end: float
    ) -> tuple[float, str]:
        """Return how far a tip gets on a way [m], looked at every 5 mm, and why no further.

        Args:
            tip_at: Returns the pose of the tip at a place on the way [m].
            q: Positions at its begin, shape (joints,).
            begin: Of the way [m].
            end: Of it [m].
        """
        reached = begin
        for place in np.linspace(begin, end, max(2, math.ceil(abs(end - begin) / LOOK) + 1)):
            try:
                q = self.solved(tip_at(float(place)), q)
            except ArmError as error:
                return reached, str(error)
            reached = float(place)
        return end, ""

    def speeds(self, q: FloatArray, direction: FloatArray) -> FloatArray:
        """Return joint speeds that carry the tip at a velocity without turning it.

        Args:
            q: Positions, shape (joints,).
            direction: Velocity in the base [m/s], shape (3,).

        Returns:
            Speeds [rad/s or m/s], shape (joints,); large near a singularity.
        """
        slopes = self.jacobian(q)
        own = self.tip(q).rotation.T @ direction
        normal = slopes.T @ slopes + _DAMPING**2 * np.eye(q.size)
        return np.linalg.solve(normal, slopes.T @ np.concatenate([own, np.zeros(3)]))

    def fastest(self, q: FloatArray, direction: FloatArray) -> tuple[float, Joint]:
        """Return how fast the tip may go [m/s], and the joint that allows no more.

        Args:
            q: Positions, shape (joints,).
            direction: Way of the tip in the base for a metre that counts, shape (3,).
        """
        shares = np.abs(self.speeds(q, direction)) / self._speed_limits
        worst = int(np.argmax(shares))
        return SPEED_SHARE / max(float(shares[worst]), _NO_SHARE), self.joints[worst]

    def _moved(self, q: FloatArray) -> pinocchio.SE3:
        pinocchio.framesForwardKinematics(self._model, self._data, self._whole(q))
        placed = self._data.oMf
        return placed[self._base].actInv(placed[self._tip])

    def _whole(self, q: FloatArray) -> FloatArray:
        self._q[self._places] = q
        return self._q

    def _link(self, name: str) -> int:
        if not self._model.existFrame(name):
            known = [frame.name for frame in self._model.frames if "joint" not in frame.name]
            raise ArmError(f"the robot description has no link {name}, it has {', '.join(known)}")
        return int(self._model.getFrameId(name))

    def _chain(self, link: str) -> list[int]:
        """Return the joints from the root to a link."""
        frame = self._model.frames[self._link(link)]
        # Pinocchio 2 has it by its older name.
        joint = frame.parentJoint if hasattr(frame, "parentJoint") else frame.parent
        return [int(k) for k in self._model.supports[joint]][1:]

    def _joint(self, index: int) -> Joint:
        joint, name = self._model.joints[index], self._model.names[index]
        if (joint.nq, joint.nv) != (1, 1):
            raise ArmError(
                f"{name} turns without an end or has several axes: write it as a revolute joint "
                "with limits"
            )
        low = float(self._model.lowerPositionLimit[joint.idx_q])
        high = float(self._model.upperPositionLimit[joint.idx_q])
        return Joint(name, low, high, float(self._model.velocityLimit[joint.idx_v]))
