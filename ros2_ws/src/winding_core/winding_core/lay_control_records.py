"""What the controller of the lay says at every step, as one structured dtype."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray


class ControlMode(IntEnum):
    """What the controller does with what it finds."""

    OFF = 0
    WATCH = 1
    DRIVE = 2


class ControlBasis(IntEnum):
    """What a command rests on: a measured lay, the model alone, or the drive programme."""

    MEASURED = 0
    MODEL = 1
    RAMP = 2


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
