"""The machine as URDF: what stands where, and what moves with which joint."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from winding_core.cable.condition import ResolvedCondition
from winding_core.machine.axes import MachineAxes
from winding_core.run_options import CameraPlacement

# Frames as the graph's messages name them.
BASE, CYLINDER, GUIDE = "winder_axis", "cylinder", "guide"
MARKER, LOAD_CELL, CAMERA = "p0", "load_cell", "camera_optical_frame"

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
    for name in ("cylinder_scale", "carriage_scale"):
        if abs(scale := getattr(axes, name)) != 1.0:
            raise ValueError(f"a URDF joint is in rad or m: {name} must be 1 or -1, got {scale:g}")
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
    end = float(what.drive.positions(what.duration)[1])
    return environment.get_template("winding_machine.urdf.j2").render(
        base=BASE, cylinder=CYLINDER, guide=GUIDE, marker=MARKER, load_cell=LOAD_CELL,
        camera_frame=CAMERA, axes=axes, case=what.case, free_length=what.free_length,
        feed_speed=abs(what.drive.feed_speed), end=end, way=abs(end), margin=_MARGIN,
        quarter_turn=0.5 * math.pi, camera=camera,
        camera_rpy=_roll_pitch_yaw(_FACING @ _rotation(camera.camera_tilt)) if camera else None,
    )  # fmt: skip


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
