"""The machine as URDF: what stands where, and what moves with which joint."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from winding_core.camera_placement import CameraPlacement
from winding_core.condition import ResolvedCondition
from winding_core.machine_axes import MachineAxes

# Frames as the graph's messages name them.
BASE, CYLINDER, GUIDE = "winder_axis", "cylinder", "guide"
MARKER, LOAD_CELL, CAMERA = "p0", "load_cell", "camera_optical_frame"

_COLOURS = {"drum": "0.75 0.75 0.78 1", "machine": "0.35 0.35 0.4 1", "band": "0.9 0.65 0.0 1"}
# The drum is drawn beyond the first and the last turn by this much [m].
_MARGIN = 0.02
# Camera x, y, z (right, down, forward) in the lab frame, as columns, where it is not tilted.
_FACING = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])


def machine_urdf(
    what: ResolvedCondition, axes: MachineAxes, camera: CameraPlacement | None = None
) -> str:
    """Return the machine's URDF; its joints take the positions of rig/joint_states as they come.

    The root `winder_axis` has the cylinder's axis along +z and the landing azimuth on +x. The
    cylinder carries P0 on the cable's centreline, the guide is the eye at the end of the tangent
    span, with the load cell's x along the cable.

    Args:
        what: Is wound, with cylinder, cable, span and drive.
        axes: Joint names, signs and offsets.
        camera: Where the camera stands; None for a machine without one.

    Raises:
        ValueError: A joint does not count in radians or metres, which a URDF cannot scale.
    """
    robot = ET.Element("robot", name="winding_machine")
    for name, colour in _COLOURS.items():
        ET.SubElement(ET.SubElement(robot, "material", name=name), "color", rgba=colour)
    case = what.case
    end = float(what.drive.positions(what.duration)[1])
    way = abs(end)
    ET.SubElement(robot, "link", name=BASE)

    length = way + 2.0 * _MARGIN
    drum = _link(robot, CYLINDER, "drum", "cylinder", radius=case.cylinder_radius, length=length)
    ET.SubElement(drum, "origin", xyz=_text([0.0, 0.0, 0.5 * end]), rpy=_text([0.0, 0.0, 0.0]))
    turn = _sign("cylinder_scale", axes.cylinder_scale)
    joint = _joint(
        robot, axes.cylinder_joint, "continuous", BASE, CYLINDER,
        rpy=(0.0, 0.0, -turn * axes.cylinder_offset),
    )  # fmt: skip
    ET.SubElement(joint, "axis", xyz=_text([0.0, 0.0, turn]))
    _link(robot, MARKER, "band", "sphere", radius=case.cable_radius)
    _joint(robot, "p0_joint", "fixed", CYLINDER, MARKER, xyz=(case.centreline_radius, 0.0, 0.0))

    _link(robot, GUIDE, "machine", "sphere", radius=2.0 * case.cable_radius)
    along = _sign("carriage_scale", axes.carriage_scale)
    offset = axes.carriage_offset
    joint = _joint(
        robot, axes.carriage_joint, "prismatic", BASE, GUIDE,
        xyz=(case.centreline_radius, -what.free_length, -along * offset),
    )  # fmt: skip
    ET.SubElement(joint, "axis", xyz=_text([0.0, 0.0, along]))
    # Commands may lead to either side of the way that the drive programme takes.
    ET.SubElement(
        joint,
        "limit",
        lower=repr(offset - way - 1.0),
        upper=repr(offset + way + 1.0),
        effort=repr(case.weight),
        velocity=repr(abs(what.drive.feed_speed)),
    )
    ET.SubElement(robot, "link", name=LOAD_CELL)
    _joint(robot, "load_cell_joint", "fixed", GUIDE, LOAD_CELL, rpy=(0.0, 0.0, 0.5 * math.pi))

    if camera is not None:
        _link(robot, CAMERA, "machine", "box", size=_text([0.03, 0.03, 0.05]))
        turned = _FACING @ _rotation(camera.camera_tilt)
        _joint(
            robot, "camera_joint", "fixed", BASE, CAMERA,
            xyz=camera.camera_position, rpy=_roll_pitch_yaw(turned),
        )  # fmt: skip
    ET.indent(robot)
    return '<?xml version="1.0"?>\n' + ET.tostring(robot, encoding="unicode") + "\n"


def _link(
    robot: ET.Element, name: str, material: str, shape: str, **size: float | str
) -> ET.Element:
    """Add a link and return its visual."""
    visual = ET.SubElement(ET.SubElement(robot, "link", name=name), "visual")
    geometry = ET.SubElement(visual, "geometry")
    ET.SubElement(geometry, shape, {key: str(value) for key, value in size.items()})
    ET.SubElement(visual, "material", name=material)
    return visual


def _joint(
    robot: ET.Element,
    name: str,
    kind: str,
    parent: str,
    child: str,
    *,
    xyz: Sequence[float] = (0.0, 0.0, 0.0),
    rpy: Sequence[float] = (0.0, 0.0, 0.0),
) -> ET.Element:
    """Add a joint at a place [m] and a roll, pitch and yaw [rad] of its parent."""
    joint = ET.SubElement(robot, "joint", name=name, type=kind)
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    ET.SubElement(joint, "origin", xyz=_text(xyz), rpy=_text(rpy))
    return joint


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


def _sign(name: str, scale: float) -> float:
    if abs(scale) != 1.0:
        raise ValueError(f"a URDF joint is in rad or m: {name} must be 1 or -1, got {scale:g}")
    return scale


def _text(numbers: Sequence[float]) -> str:
    return " ".join(repr(float(number)) for number in numbers)
