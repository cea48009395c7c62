"""Records of a lay, measured or controlled, and where a predicted cable lies.

One structured dtype each for topic, files and programs.
"""

from enum import IntEnum, IntFlag

import numpy as np
from numpy.typing import NDArray


class LayFlag(IntFlag):
    """What is wrong with a place of the wound cable; zero means that it lies as it should."""

    GAP = 1
    OVERLAP = 2
    CLIMB = 4


def name_of(flag: LayFlag) -> str:
    """Return what people call one flag."""
    return str(flag.name).lower()


# Places of the wound cable: position, whole turns behind P0, wound angle [rad], one standard
# deviation of z [m], distance from the turn before [m], height above cable on the cylinder [m],
# LayFlag bits. x, y, z are single precision because RViz displays no other point clouds.
LAY_DTYPE = np.dtype(
    [
        ("x", "<f4"),
        ("y", "<f4"),
        ("z", "<f4"),
        ("turn", "<u4"),
        ("theta", "<f8"),
        ("sigma_z", "<f8"),
        ("pitch", "<f8"),
        ("lift", "<f8"),
        ("flags", "<u4"),
    ],
    align=True,
)

LayRecords = NDArray[np.void]


class ControlMode(IntEnum):
    """What the controller does with what it finds."""

    OFF = 0
    WATCH = 1
    DRIVE = 2


class ControlBasis(IntEnum):
    """What a command rests on: a measured lay, the model alone, or the drive programme.

    RAMP follows the programme because the solver is silent, LATE because commands leave late.
    """

    MEASURED = 0
    MODEL = 1
    RAMP = 2
    LATE = 3


# One record per message. x, y, z: where the cable lands [m]; theta: wound angle there [rad];
# wanted_z, sigma_z [m]; guide, guide_speed: what is commanded, or would be [m, m/s]; pull [N], nan
# where none is commanded; free_length and load_share with one standard deviation each; mode and
# basis as above; limited: 1 where a bound of the carriage holds the guide back.
LAY_CONTROL_DTYPE = np.dtype(
    [
        ("x", "<f4"),
        ("y", "<f4"),
        ("z", "<f4"),
        ("mode", "<u4"),
        ("theta", "<f8"),
        ("wanted_z", "<f8"),
        ("sigma_z", "<f8"),
        ("guide", "<f8"),
        ("guide_speed", "<f8"),
        ("pull", "<f8"),
        ("free_length", "<f8"),
        ("sigma_free_length", "<f8"),
        ("load_share", "<f8"),
        ("sigma_load_share", "<f8"),
        ("basis", "<u4"),
        ("limited", "<u4"),
    ],
    align=True,
)

LayControlRecords = NDArray[np.void]


Array = NDArray[np.float64]

_SHORT = 0.2  # The free span leaves the cylinder within so much of its radius


def cable_lay(cable: NDArray[np.void], cylinder_angle: float, radius: float) -> tuple[Array, Array]:
    """Return wound angle [rad] and z [m] of the nodes that lie on the cylinder, shape (n,) each.

    Args:
        cable: Records of CABLE_DTYPE, in order along the cable; older turns may be missing.
        cylinder_angle: Theta [rad] at the cable's time.
        radius: Centreline radius R + r [m].
    """
    x, y, z = (cable[name].astype(float) for name in "xyz")
    # The span, behind the contact line on the side of the guide, comes last in the cable.
    landed = np.flatnonzero((y > -_SHORT * radius) & (x > 0.0))
    if not landed.size:
        return np.zeros(0), np.zeros(0)
    wound = np.arange(landed[-1] + 1)
    azimuth = np.arctan2(y[wound], x[wound])
    # The newest node lies near the contact line, at azimuth 0; the others follow from it.
    turned = np.unwrap(azimuth)
    return cylinder_angle - azimuth[-1] + turned[-1] - turned, z[wound]
