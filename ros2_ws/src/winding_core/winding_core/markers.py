"""Markers: their records, what they look like, and where the first one stands."""

import math
from dataclasses import dataclass
from enum import IntFlag

import numpy as np
from numpy.typing import ArrayLike, NDArray

from winding_core.helix import curve_length
from winding_core.parameters import ParameterError, parameter
from winding_core.units import ANGLE, HUE, LENGTH, PLAIN


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
    raised: ArrayLike = 0.0,
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
        raised: Height above that radius of cable that lies on cable [m]; it moves x and y alone.
    """
    theta = np.asarray(theta, dtype=float)
    records = np.zeros(theta.shape, dtype=MARKER_DTYPE)
    azimuth = cylinder_angle - theta
    records["id"] = ids
    outer = radius + np.asarray(raised)
    records["x"] = outer * np.cos(azimuth)
    records["y"] = outer * np.sin(azimuth)
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


BAND, DOT = "band", "dot"

# Hues of paints by name [deg].
COLOURS = {
    "red": 0.0,
    "orange": 25.0,
    "yellow": 50.0,
    "green": 120.0,
    "cyan": 180.0,
    "blue": 230.0,
    "magenta": 300.0,
}


@dataclass(frozen=True, kw_only=True)
class MarkerLook:
    """What a marker is, how large and of which colour."""

    marker_kind: str = parameter(
        BAND, "what a marker is: a ring around the cable, or a square printed on its outside",
        PLAIN, choices=(BAND, DOT),
    )  # fmt: skip
    band_width: float = parameter(
        0.006, "width of a marker band along the cable", LENGTH, 0.0005, 0.05, option="band"
    )
    dot_size: float = parameter(
        0.003, "side of the square of a marker that is a dot", LENGTH, 0.0005, 0.02, option="dot"
    )
    marker_colours: str = parameter(
        "", "colours of P0, P1 and so on, separated by commas, the last one for all further "
        f"markers: {', '.join(COLOURS)}, or hues in deg; empty where all have one colour",
        PLAIN,
    )  # fmt: skip

    @property
    def hues(self) -> tuple[float, ...]:
        """Hues of P0, P1 and so on [deg]; empty where all markers have one colour.

        Raises:
            ParameterError: A colour that is neither a known name nor a hue, or two colours that
                are too similar to be distinguished.
        """
        words = [word.strip().lower() for word in self.marker_colours.split(",")]
        hues = tuple(_hue(word) for word in words) if self.marker_colours.strip() else ()
        different = sorted(set(hues))
        for one, other in zip(different, different[1:] + different[:1], strict=True):
            if one != other and abs(math.remainder(one - other, 360.0)) < LEAST_APART:
                raise ParameterError(
                    f"parameter marker_colours must have hues {LEAST_APART:g} deg apart, got "
                    f"{one:g} and {other:g}"
                )
        return hues


LEAST_APART = 20.0  # Smallest difference of paints that are distinguished by their hue alone [deg]


def _hue(word: str) -> float:
    if word in COLOURS:
        return COLOURS[word]
    try:
        hue = float(word)
    except ValueError:
        hue = math.nan
    if not 0.0 <= hue < 360.0:
        raise ParameterError(
            f"parameter marker_colours must list {', '.join(COLOURS)} or hues of 0 to 360 deg, "
            f"got {word[:40]!r}"
        )
    return hue


@dataclass(frozen=True, kw_only=True)
class MarkerParameters(MarkerLook):
    """How markers look, how that is recognised, and where P0 is when a run begins."""

    marker_hue: float = parameter(
        50.0, "hue of the markers, 0 red, 60 yellow, 120 green, 240 blue", HUE, 0.0, 360.0
    )
    marker_hue_tolerance: float = parameter(
        22.0, "how far the hue of a marker may lie from that", HUE, 1.0, 90.0
    )
    dot_torsion: float = parameter(
        0.05,
        "by how much the cable is twisted about itself at a dot, one standard deviation",
        ANGLE, 0.0, 1.5,
    )  # fmt: skip
    start_angle: float = parameter(
        0.0,
        "where P0 stands at the first frame, from where the cable lands, in winding direction",
        ANGLE, -3.2, 400.0,
        otherwise="the encoder's, or else that of P0's passes",
    )  # fmt: skip
