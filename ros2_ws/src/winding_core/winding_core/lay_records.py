"""The record of a measured lay: one structured dtype for topic, files and programs."""

from __future__ import annotations

from enum import IntFlag

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
