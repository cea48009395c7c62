"""What the arm reports becomes the guide's place; what is wanted of the guide leads the arm."""

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from winding_arm_driver.leading import GuideLead, Led
from winding_core.arm.arm_file import ArmMapping
from winding_core.arm.kinematics import Arm
from winding_core.arm.rigid import FloatArray, Pose
from winding_core.machine.commands import CARRIAGE, JointTargets
from winding_core.machine.joining import Joiner
from winding_core.machine.readings import AxisReading, GuidePlace

_MOST_FRAMES = 1000  # A chain that is longer leads in a circle


class FrameTree:
    """Newest transforms from parents to children, as TF publishes them."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, Pose]] = {}

    def add(self, parent: str, child: str, pose: Pose) -> None:
        """Take where a child frame stands in its parent."""
        self._parents[child] = (parent, pose)

    def chain(self, frame: str) -> list[str]:
        """Return a frame and its parents, the root last.

        Raises:
            ValueError: They lead in a circle.
        """
        found = [frame]
        while found[-1] in self._parents:
            found.append(self._parents[found[-1]][0])
            if len(found) > _MOST_FRAMES:
                raise ValueError(f"the parents of frame {frame} lead in a circle")
        return found

    def between(self, base: str, tip: str) -> Pose | None:
        """Return where a tip stands in a base; None where no transforms join them.

        Raises:
            ValueError: Their parents lead in a circle.
        """
        up, down = self.chain(base), self.chain(tip)
        shared = next((frame for frame in up if frame in down), None)
        if shared is None:
            return None
        return self._from(shared, base).inverse() @ self._from(shared, tip)

    def _from(self, ancestor: str, frame: str) -> Pose:
        pose = Pose.standing()
        while frame != ancestor:
            parent, own = self._parents[frame]
            pose, frame = own @ pose, parent
        return pose


_ANGLE, _PLACE = "angle", ("x", "y", "z")
# How long a value of the cylinder waits for one of the guide, and the other way round [s].
WAIT = 0.1
_MOTION, _STANDS = 2.0e-3, 0.3  # A cylinder that turns by less in so long stands [rad], [s]
_SILENT = 1.0  # Without a report for so long the guide is silent [s]


class Guided:
    """The guide of one machine.

    Raises:
        ArmError: The arm's description cannot be used.
    """

    def __init__(self, mapping: ArmMapping) -> None:
        guide = mapping.guide
        self._mapping = mapping
        axis = mapping.winder_axis.pose
        self._seen = axis.inverse()
        self._arm = Arm(Path(guide.urdf), guide.base, guide.tip) if guide.urdf else None
        self._eye = np.array(guide.eye_m, dtype=float)
        self._frames = FrameTree()
        self._joiner = Joiner((_ANGLE, *_PLACE), WAIT)
        self._tip: Pose | None = None
        self._joints: FloatArray | None = None
        self._heard = {"cylinder": -np.inf, "guide": -np.inf}
        # Angle at which the cylinder was last seen to have turned [rad], and when [s].
        self._rested, self._turned = math.nan, -math.inf
        self.lead = GuideLead(mapping.commands, axis, self._eye, self._arm)  # What leads the guide

    @property
    def joint_names(self) -> list[str]:
        """Names of the arm's joints in the order of its commands; empty without kinematics."""
        return [joint.name for joint in self._arm.joints] if self._arm is not None else []

    def add_cylinder(self, stamp_ns: int, position: float, now: float) -> None:
        """Take a position of the cylinder's joint in its own unit, at a monotonic time [s].

        Raises:
            ValueError: It is not finite.
        """
        angle = self._mapping.cylinder.scale * position
        if not np.isfinite(angle):
            raise ValueError(f"the cylinder's position must be finite, got {position}")
        self._heard["cylinder"] = now
        if math.isnan(self._rested):
            self._rested = angle
        elif abs(angle - self._rested) > _MOTION:
            self._turned, self._rested = now, angle
        self._joiner.add(_ANGLE, stamp_ns, angle, now)

    def add_joints(self, stamp_ns: int, by_name: Mapping[str, float], now: float) -> None:
        """Take positions of the arm's joints [rad or m], at a monotonic time [s].

        Raises:
            ValueError: One is missing or not finite.
        """
        assert self._arm is not None
        joints = self._arm.positions(by_name)
        if not np.isfinite(joints).all():
            raise ValueError(f"the arm's joints must be finite, got {joints.tolist()}")
        self._joints = joints
        self.add_tip(stamp_ns, self._arm.tip(joints), now)

    def add_tip(self, stamp_ns: int, tip: Pose, now: float) -> None:
        """Take where the tip stands in the base, at a monotonic time [s]."""
        self._tip = tip
        self._heard["guide"] = now
        eye = self._seen.point(tip.point(self._eye))
        for name, number in zip(_PLACE, eye.tolist(), strict=True):
            self._joiner.add(name, stamp_ns, number, now)

    def add_transform(self, parent: str, child: str, pose: Pose) -> None:
        """Take where a child frame stands in its parent."""
        self._frames.add(parent, child, pose)

    def look_up(self, stamps_ns: Mapping[str, int], now: float) -> None:
        """Take the tip where the newest transforms have it.

        Args:
            stamps_ns: Of the frames that have just been moved; where none of them joins base and
                tip, as where others publish on the same topic, the guide was not reported.
            now: Monotonic time [s].

        Raises:
            ValueError: The transforms lead in a circle.
        """
        base, tip = self._mapping.guide.base, self._mapping.guide.tip
        # Ancestors of both have no part in where one stands in the other.
        joining = {*self._frames.chain(base)} ^ {*self._frames.chain(tip)}
        moved = [stamp for frame, stamp in stamps_ns.items() if frame in joining]
        pose = self._frames.between(base, tip)
        if moved and pose is not None:
            self.add_tip(max(moved), pose, now)

    def readings(self, now: float) -> list[tuple[int, AxisReading]]:
        """Return stamps [ns] and readings that are complete at a monotonic time [s].

        Speeds are nan: the readers take slopes.
        """
        found = []
        for sample in self._joiner.take(now):
            x, y, z = (sample.values[name] for name in _PLACE)
            reading = AxisReading(
                cylinder_angle=sample.values[_ANGLE],
                angular_speed=np.nan,
                carriage_position=z,
                feed_speed=np.nan,
                guide=GuidePlace(x=x, y=y),
            )
            found.append((sample.stamp_ns, reading))
        return found

    def turning(self, now: float) -> bool:
        """Return whether the cylinder turns at a monotonic time [s]."""
        return now - self._turned < _STANDS

    def aim(self, targets: JointTargets, now: float, *, turning: bool) -> None:
        """Take targets of the axes at a time of their clock [s]; whether the cylinder turns.

        Raises:
            ValueError: They cannot be followed; nothing changes.
        """
        if set(targets.axes) != {CARRIAGE}:
            raise ValueError(
                f"the arm leads the guide alone: targets must be of the {CARRIAGE}, "
                f"got {', '.join(targets.axes)}"
            )
        if not turning:
            raise ValueError("targets are taken while the cylinder turns; it stands")
        age, timeout = now - targets.t, self._mapping.commands.timeout_s
        if targets.t and abs(age) > timeout:
            raise ValueError(
                f"a target's stamp must be within {timeout:g} s of the clock, got {age:.4g} s"
            )
        if self._tip is None:
            raise ValueError("the guide cannot be led before the arm has reported where it stands")
        self.lead.aim(
            targets.axes[CARRIAGE],
            stamp=targets.t or now,
            now=now,
            tip=self._tip,
            joints=self._joints,
        )

    def advance(self, t: float, dt: float, *, turning: bool) -> Led | None:
        """Lead the guide from t [s] on by dt [s]; None while no target has come.

        Where the cylinder does not turn the guide comes to rest.
        """
        return None if self._tip is None else self.lead.advance(t, dt, self._tip, turning=turning)

    def silence(self, now: float) -> str:
        """Return what has not been reported for a while at a monotonic time [s], or nothing."""
        late = [name for name, heard in self._heard.items() if now - heard > _SILENT]
        topics = {"cylinder": self._mapping.cylinder.topic, "guide": self._mapping.guide.topic}
        return ", ".join(f"nothing of the {name} arrives on {topics[name]}" for name in late)
