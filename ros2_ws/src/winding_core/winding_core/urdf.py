"""The machine as URDF: what stands where, and what moves with which joint."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np
from numpy.typing import ArrayLike, NDArray

from winding_core.cable.condition import ResolvedCondition
from winding_core.machine.axes import MachineAxes
from winding_core.run_options import CameraPlacement

if TYPE_CHECKING:
    from winding_core.arm.arm_path import ArmPath

# Frames as the graph's messages name them.
BASE, CYLINDER, GUIDE = "winder_axis", "cylinder", "guide"
MARKER, LOAD_CELL, CAMERA = "p0", "load_cell", "camera_optical_frame"

_MARGIN = 0.02  # The drum is drawn beyond the first and the last turn by this much [m]
# Camera x, y, z (right, down, forward) in the lab frame, as columns, where it is not tilted.
_FACING = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])


# Physics engines want masses: those of solid aluminium [kg/m^3], and of a carriage [kg].
_DENSITY = 2700.0
_CARRIAGE_MASS = 1.0
_EYE = 2.0  # The eye of the guide is drawn larger than the cable by this factor


@dataclass(frozen=True, kw_only=True)
class CarriageLimits:
    """What the carriage can do; by default the simulated machine's."""

    low: float = -0.1  # Start of its travel, from where it stands beside P0 [m]
    high: float = 1.0  # Its end [m]
    speed: float = 0.08  # Largest speed [m/s]


@dataclass(frozen=True, kw_only=True)
class _Joint:
    """A joint of the machine, and the one that moves the model with it.

    Attributes:
        origin: Position of the model's joint where the machine's reads 0 [rad or m].
        lower: Of the model's joint, and `upper` [rad or m].
    """

    joint: str  # Its name on rig/joint_states
    unit: str  # Of the model's joint
    scale: float  # Radians or metres for one of its units
    offset: float  # Its position at the run's origin, in its own unit
    low: float = 0.0  # Travel [m]
    high: float = 0.0  # Its end [m]

    @property
    def mimics(self) -> bool:
        """Whether the model needs a joint of its own, in radians or metres."""
        return abs(self.scale) != 1.0

    @property
    def name(self) -> str:
        return f"{self.joint}_in_{self.unit}" if self.mimics else self.joint

    @property
    def origin(self) -> float:
        return -self.scale * self.offset

    @property
    def turned(self) -> float:
        """Pose of the model's joint at its position 0 [rad or m]."""
        return 0.0 if self.mimics else self.origin

    @property
    def sign(self) -> float:
        return 1.0 if self.mimics else self.scale

    @property
    def lower(self) -> float:
        return self._ends()[0]

    @property
    def upper(self) -> float:
        return self._ends()[1]

    def _ends(self) -> tuple[float, float]:
        if self.mimics:
            return self.low, self.high
        ends = [self.offset + self.scale * end for end in (self.low, self.high)]
        return min(ends), max(ends)


@dataclass(frozen=True, kw_only=True)
class _Body:
    """Mass [kg], and moments of inertia about z and across it [kg m^2]."""

    mass: float
    about: float
    across: float


def _drum(radius: float, length: float) -> _Body:
    mass = _DENSITY * math.pi * radius**2 * length
    across = mass * (3.0 * radius**2 + length**2) / 12.0
    return _Body(mass=mass, about=0.5 * mass * radius**2, across=across)


def _ball(mass: float, radius: float) -> _Body:
    moment = 0.4 * mass * radius**2
    return _Body(mass=mass, about=moment, across=moment)


def machine_urdf(
    what: ResolvedCondition,
    axes: MachineAxes,
    camera: CameraPlacement | None = None,
    carriage: CarriageLimits | None = None,
    arm: ArmPath | None = None,
) -> str:
    """Return the machine's URDF; its joints take the positions of rig/joint_states as they come.

    The root `winder_axis` has the cylinder's axis along +z and the landing azimuth on +x. The
    cylinder carries P0 on the cable's centreline, the guide is the eye at the end of the tangent
    span, with the load cell's x along the cable. A joint of rig/joint_states that does not count
    in radians or metres is mimicked by one that does, named after it with `_in_rad` or `_in_m`.

    Args:
        what: Is wound, with cylinder, cable, span and drive.
        axes: Joint names, signs and offsets.
        camera: Where the camera stands; None for a machine without one.
        carriage: What the carriage can do; its travel is drawn out to where the run takes it.
        arm: What carries the guide in its place; its own description becomes a part of this one.
    """
    limits = carriage or CarriageLimits()
    # Most programs that know the frames write no description.
    from jinja2 import Environment, PackageLoader, StrictUndefined  # noqa: PLC0415

    environment = Environment(
        loader=PackageLoader("winding_core"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    end, case = float(what.drive.positions(what.duration)[1]), what.case
    length, eye = abs(end) + 2.0 * _MARGIN, _EYE * case.cable_radius
    turning = _Joint(
        joint=axes.cylinder_joint,
        unit="rad",
        scale=axes.cylinder_scale,
        offset=axes.cylinder_offset,
    )
    sliding = _Joint(
        joint=axes.carriage_joint,
        unit="m",
        scale=axes.carriage_scale,
        offset=axes.carriage_offset,
        low=min(limits.low, end),
        high=max(limits.high, end),
    )
    return environment.get_template("winding_machine.urdf.j2").render(
        base=BASE, cylinder=CYLINDER, guide=GUIDE, marker=MARKER, load_cell=LOAD_CELL,
        camera_frame=CAMERA, turning=turning, sliding=sliding, case=case,
        free_length=what.free_length, end=end, drum_length=length, eye_radius=eye,
        speed=max(abs(what.drive.feed_speed), axes.carriage_speed, limits.speed),
        drum=_drum(case.cylinder_radius, length), eye=_ball(_CARRIAGE_MASS, eye),
        housing=_drum(0.017, 0.05), small=_ball(1.0e-3, 0.05), quarter_turn=0.5 * math.pi,
        camera=camera, arm=None if arm is None else _arm(arm),
        camera_rpy=_roll_pitch_yaw(_FACING @ _rotation(camera.camera_tilt)) if camera else None,
    )  # fmt: skip


def _arm(path: ArmPath) -> dict[str, object]:
    """Return the arm's description, and where it stands and carries the guide."""
    guide = path.mapping.guide
    root = ElementTree.fromstring(Path(guide.urdf).read_text(encoding="utf-8"))
    base, eye = path.base, path.guide
    return {
        "links": "\n".join(ElementTree.tostring(part, "unicode") for part in root),
        "base": guide.base,
        "tip": guide.tip,
        "base_xyz": base.position.tolist(),
        "base_rpy": _roll_pitch_yaw(base.rotation),
        "eye_xyz": eye.position.tolist(),
        "eye_rpy": _roll_pitch_yaw(eye.rotation),
    }


def _rotation(vector: ArrayLike) -> NDArray[np.float64]:
    """Return the matrix of a rotation vector [rad] (Rodrigues), shape (3, 3)."""
    x, y, z = way = np.asarray(vector, dtype=float)
    angle = math.hypot(x, y, z)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    # sin(a) / a, and (1 - cos(a)) / a^2 without the difference.
    first = float(np.sinc(angle / math.pi))
    second = 0.5 * float(np.sinc(0.5 * angle / math.pi)) ** 2
    return np.asarray(math.cos(angle) * np.eye(3) + first * cross + second * np.outer(way, way))


def _roll_pitch_yaw(turn: NDArray[np.float64]) -> list[float]:
    """Return the angles [rad] about fixed x, y, z of a rotation matrix, shape (3, 3).

    The camera's nominal pose has a pitch of a quarter turn, where roll and yaw are one: the roll
    is then 0. Near it, angles from the arc sine alone would be wrong by the root of a rounding.
    """
    pitch = math.atan2(-turn[2, 0], math.hypot(turn[0, 0], turn[1, 0]))
    roll = math.atan2(turn[2, 1], turn[2, 2])
    if math.hypot(turn[0, 0], turn[1, 0]) < 1.0e-12:
        roll = 0.0
    # Yaw from what is left when pitch and roll are taken out.
    s, c = math.sin(roll), math.cos(roll)
    yaw = math.atan2(turn[0, 2] * s - turn[0, 1] * c, turn[1, 1] * c - turn[1, 2] * s)
    return [roll, pitch, yaw]
