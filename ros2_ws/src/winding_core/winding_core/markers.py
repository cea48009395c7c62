"""The marker record: one structured dtype for every place that says where markers lie."""

from __future__ import annotations

from enum import IntFlag

import numpy as np
from numpy.typing import ArrayLike, NDArray

from winding_core.helix import curve_length


class MarkerFlag(IntFlag):
    """What is known against a marker's numbers; zero means a plain good value.

    PREDICTED: taken over from an earlier frame or a model, not seen in this frame.
    """

    OCCLUDED = 1
    CLIPPED = 2
    TOUCHING = 4
    SLIPPED = 8
    NOT_WOUND = 16
    PREDICTED = 32


# x, y, z are single precision because RViz displays no other point clouds.
_MARKER_FIELDS = [
    ("x", "<f4"),
    ("y", "<f4"),
    ("z", "<f4"),
    ("id", "<u4"),
    ("r", "<f8"),
    ("theta", "<f8"),
    ("s", "<f8"),
    ("sigma_theta", "<f8"),
    ("sigma_z", "<f8"),
    ("flags", "<u4"),
]
_CORRECTION_FIELDS = [("s_fem", "<f8"), ("h", "<f8"), ("s_low", "<f8"), ("s_high", "<f8")]

MARKER_DTYPE = np.dtype(_MARKER_FIELDS, align=True)
CORRECTED_DTYPE = np.dtype([*_MARKER_FIELDS, *_CORRECTION_FIELDS], align=True)

# Nodes of the cable's centreline: position, undeformed arc length, tension [N], strain.
CABLE_DTYPE = np.dtype(
    [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("s", "<f8"), ("tension", "<f8"), ("strain", "<f8")],
    align=True,
)

Markers = NDArray[np.void]


def wound_markers(
    *,
    ids: ArrayLike,
    theta: ArrayLike,
    z: ArrayLike,
    radius: float,
    cylinder_angle: float,
    sigma_theta: ArrayLike = 0.0,
    sigma_z: ArrayLike = 0.0,
    flags: ArrayLike = 0,
) -> Markers:
    """Return marker records for cable wound at a centreline radius.

    The lab frame has +z along the cylinder; the cable lands at azimuth zero and P0 stands at
    azimuth `cylinder_angle`, so a marker wound theta behind P0 stands at
    cylinder_angle - theta.

    Args:
        ids: Marker numbers n, shape (n,).
        theta: Wound angle of each marker relative to P0 [rad], unwrapped, shape (n,).
        z: Axial position relative to P0 [m], shape (n,).
        radius: Centreline radius R + r [m].
        cylinder_angle: Theta [rad] of the cylinder at the records' time.
        sigma_theta: One standard deviation of theta [rad].
        sigma_z: One standard deviation of z [m].
        flags: MarkerFlag bits.
    """
    theta = np.asarray(theta, dtype=float)
    records = np.zeros(theta.shape, dtype=MARKER_DTYPE)
    azimuth = cylinder_angle - theta
    records["id"] = ids
    records["x"] = radius * np.cos(azimuth)
    records["y"] = radius * np.sin(azimuth)
    records["z"] = z
    records["r"] = radius
    records["theta"] = theta
    records["s"] = curve_length(radius, theta, np.asarray(z, dtype=float))
    records["sigma_theta"] = sigma_theta
    records["sigma_z"] = sigma_z
    records["flags"] = flags
    return records


def positions(markers: Markers) -> NDArray[np.float64]:
    """Return x, y and z in the lab frame [m] of marker records of shape (n,), shape (n, 3)."""
    return np.column_stack([markers[axis] for axis in "xyz"]).astype(float)


def is_wound(markers: Markers) -> NDArray[np.bool_]:
    """Return a mask of the markers that lie on the cylinder."""
    mask: NDArray[np.bool_] = (markers["flags"] & MarkerFlag.NOT_WOUND) == 0
    return mask
