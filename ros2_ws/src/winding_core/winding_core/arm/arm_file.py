"""The mapping file: where cylinder and guide are reported, and what the arm is commanded with."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from winding_core.arm.rigid import Pose
from winding_core.parameters import ParameterError, build, parameter, refuse_unknown
from winding_core.yaml_text import YamlTextError, load_yaml

JOINTS, POSE, TF = "joints", "pose", "tf"
NONE, TWIST, TRAJECTORY, POSITIONS = "none", "twist", "trajectory", "positions"
ACTION = "action"
# What commands joints, and so needs the arm's kinematics.
_OF_JOINTS = (TRAJECTORY, POSITIONS, ACTION)


class MappingError(ValueError):
    """A mapping file cannot be used."""


@dataclass(frozen=True, kw_only=True)
class Cylinder:
    """Where the cylinder's encoder is reported, as a sensor_msgs/JointState."""

    topic: str = parameter("cell/joint_states", "topic of the cylinder's joint states")
    joint: str = parameter("cylinder_joint", "name of the cylinder's joint")
    scale: float = parameter(1.0, "radians per unit of the joint, negative if it counts backwards")


@dataclass(frozen=True, kw_only=True)
class Guide:
    """Where the guide's eye is reported."""

    source: str = parameter(
        JOINTS,
        "whether the arm's joint states, a stamped pose of its tool or TF reports it",
        choices=(JOINTS, POSE, TF),
    )
    topic: str = parameter("arm/joint_states", "topic of joint states or of the pose")
    urdf: str = parameter("", "file of the arm's description, for joints and for joint commands")
    base: str = parameter("base_link", "link or frame that poses are given in")
    tip: str = parameter("tool0", "link or frame that carries the guide")
    eye_m: list[float] = parameter([0.0, 0.0, 0.0], "the guide's eye in the tip's frame")


@dataclass(frozen=True, kw_only=True)
class WinderAxis:
    """Where the machine's frame `winder_axis` stands in the arm's base.

    Its z is the cylinder's axis; cable lands at +x of it and comes from -y.
    """

    position_m: list[float] = parameter([0.0, 0.0, 0.0], "its origin in the base")
    rotation_rpy_rad: list[float] = parameter(
        [0.0, 0.0, 0.0], "its roll, pitch and yaw about the base's axes, as in a URDF"
    )

    @property
    def pose(self) -> Pose:
        """The frame in the arm's base."""
        return Pose(
            position=np.array(self.position_m),
            rotation=Rotation.from_euler("xyz", self.rotation_rpy_rad).as_matrix(),
        )


@dataclass(frozen=True, kw_only=True)
class Commands:
    """How the guide is led along the cylinder's axis, and its limits."""

    type: str = parameter(
        NONE,
        "geometry_msgs/PoseStamped or TwistStamped, trajectory_msgs/JointTrajectory, or "
        "std_msgs/Float64MultiArray of joint positions, or goals of a control_msgs/"
        "FollowJointTrajectory",
        choices=(NONE, POSE, TWIST, TRAJECTORY, POSITIONS, ACTION),
    )
    topic: str = parameter("arm/command", "topic of the commands, or name of the action")
    rate_hz: float = parameter(125.0, "commands per second", None, 10.0, 1000.0)
    ahead_s: float = parameter(
        0.0, "dead time of the arm, by which commands go ahead", None, 0.0, 0.5
    )
    low_m: float = parameter(-0.05, "start of the guide's travel along the axis", None, -10.0, 10.0)
    high_m: float = parameter(0.5, "end of the guide's travel along the axis", None, -10.0, 10.0)
    speed_m_s: float = parameter(0.1, "largest speed of the guide", None, 1.0e-4, 5.0)
    acceleration_m_s2: float = parameter(0.5, "largest acceleration of it", None, 1.0e-3, 50.0)
    timeout_s: float = parameter(
        0.5, "time for which a target holds that is not repeated", None, 0.05, 10.0
    )


@dataclass(frozen=True, kw_only=True)
class SimulatedPath:
    """How the simulated machine's arm carries the eye: the only section that it alone reads."""

    home_rad: list[float] = parameter(
        [], "joint positions near the start, with the tool turned as it stays [rad or m]"
    )
    along_m: list[float] = parameter([], "places along the axis, ascending, at which a span holds")
    span_m: list[float] = parameter(
        [], "free length at those places, linear in between; otherwise the condition's"
    )
    clearance_m: float = parameter(
        0.03, "distance that the arm's links keep from the cylinder", None, 0.0, 1.0
    )


@dataclass(frozen=True, kw_only=True)
class ArmMapping:
    """A mapping file."""

    cylinder: Cylinder  # Its encoder
    guide: Guide  # How it is reported
    winder_axis: WinderAxis  # The machine's frame
    commands: Commands  # Of the arm
    path: SimulatedPath = field(default_factory=SimulatedPath)  # Of the simulated machine's arm


_SECTIONS = {
    "cylinder": Cylinder, "guide": Guide, "winder_axis": WinderAxis, "commands": Commands,
    "path": SimulatedPath,
}  # fmt: skip


def read_mapping(path: Path) -> ArmMapping:
    """Return a mapping file's content; file names in it are relative to its folder.

    Raises:
        MappingError: One sentence on the first thing that cannot be used.
    """
    try:
        return parse_mapping(path.read_text(encoding="utf-8"), path.parent)
    except (OSError, UnicodeError) as error:
        raise MappingError(f"{path} cannot be read: {error}") from None
    except MappingError as error:
        raise MappingError(f"{path}: {error}") from None


def parse_mapping(text: str, folder: Path) -> ArmMapping:
    """Return the mapping of a YAML text whose file names are relative to a folder.

    Raises:
        MappingError: One sentence on the first thing that cannot be used.
    """
    try:
        top = load_yaml(text)
        if not isinstance(top, dict):
            raise MappingError(f"the file must be a mapping of {', '.join(_SECTIONS)}")
        refuse_unknown(top, _SECTIONS, owner="the file")
        sections: dict[str, Any] = {name: _section(name, top) for name in _SECTIONS}
        mapping = ArmMapping(**sections)
    except (YamlTextError, ParameterError) as error:
        raise MappingError(str(error)) from None
    guide, commands = mapping.guide, mapping.commands
    if mapping.cylinder.scale == 0.0:
        raise MappingError("scale of cylinder must not be 0")
    joints = guide.source == JOINTS or commands.type in _OF_JOINTS
    if joints and not guide.urdf:
        raise MappingError("source joints and joint commands need the arm's urdf")
    if commands.type in _OF_JOINTS and guide.source != JOINTS:
        raise MappingError(
            f"commands of type {commands.type} need source joints, got source {guide.source}"
        )
    if not commands.low_m < commands.high_m:
        raise MappingError(
            f"low_m must be less than high_m, got {commands.low_m:g} and {commands.high_m:g}"
        )
    along, span = mapping.path.along_m, mapping.path.span_m
    if len(along) != len(span) or sorted(set(along)) != along or min(span, default=1.0) <= 0.0:
        raise MappingError(
            f"along_m must ascend and span_m hold as many positive lengths, got {along} and {span}"
        )
    file = str(folder / guide.urdf) if guide.urdf else ""
    return replace(mapping, guide=replace(guide, urdf=file))


def _section(name: str, top: dict[str, Any]) -> object:
    values = top.get(name, {})
    if not isinstance(values, dict):
        raise MappingError(f"{name} must be a mapping of names, got {values!r}")
    return build(_SECTIONS[name], values, owner=name)
