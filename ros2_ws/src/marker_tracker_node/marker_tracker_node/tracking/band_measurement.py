"""Measuring one mark in its gate: what a detector returns, and the detector of painted marks."""

from __future__ import annotations

import math
from typing import NamedTuple

from marker_tracker_node.camera.pinhole import plane_of_pixel
from marker_tracker_node.detection.band import Band, solve_band
from marker_tracker_node.detection.gate import Gates, Picture, gate_moments
from marker_tracker_node.detection.glare import LEAST_UNKNOWN, fit_outline
from marker_tracker_node.tracking.gate_prediction import HIDDEN, MEASURED, PARTLY
from marker_tracker_node.tracking.state import Setup
from winding_core.compiling import compiled

# Share of the expected area within which a gathering of pixels may be a new band, and within
# which a known band is whole: one that is covered in part would be measured beside its middle.
NEW_AREA = (0.7, 1.4)
WHOLE_AREA = (0.87, 1.2)
# Below this share of its area it is asked whether light hides a part.
GLARE_BELOW = 0.97
# So much of a band and of the edges that tell its place must be known.
LEAST_VISIBLE, LEAST_EDGES = 0.25, 0.25


class Detection(NamedTuple):
    """What a detector says of a mark in one frame.

    The tracker asks nothing else of what is painted on the cable: whatever returns this is a
    detector.

    Attributes:
        outcome: MEASURED, PARTLY, or HIDDEN with nan for azimuth and z.
        azimuth: Of the cable's centre line under the middle of the mark [rad].
        z: The same [m].
        share: Measured over expected area of the part that light does not hide.
        completeness: Share of the mark that light does not hide.
        azimuth_factor: By how much the azimuth's deviation exceeds that of a mark seen whole.
        z_factor: The same of z.
    """

    outcome: int
    azimuth: float
    z: float
    share: float
    completeness: float
    azimuth_factor: float
    z_factor: float


NOTHING = Detection(HIDDEN, math.nan, math.nan, 0.0, 1.0, 1.0, 1.0)


@compiled
def measure_band(
    picture: Picture,
    setup: Setup,
    gates: Gates,
    n: int,
    band: Band,
    pixels: float,
    area: float,
    limits: tuple[float, float],
) -> Detection:  # pragma: no cover
    """Measure what is painted on the cable as its `Body` says: a ring, or a patch of it.

    Args:
        picture: Frame, and the colour that is sought.
        setup: Machine and camera.
        gates: Where to look.
        n: Which of them.
        band: As expected.
        pixels: That it should fill [px].
        area: Its usual share of them (dimensionless).
        limits: Least and most accepted share of the expected area.
    """
    least, most = limits
    count, column, row = gate_moments(picture, gates, n)
    share = count / max(pixels * area, 1.0)
    outcome, completeness, azimuth_factor, z_factor = MEASURED, 1.0, 1.0, 1.0
    if share < GLARE_BELOW and count >= 4:
        fit = fit_outline(picture, gates, n, setup.camera, setup.body, band, area)
        if fit.unknown >= LEAST_UNKNOWN:
            outcome = PARTLY
            share = fit.marked / max(fit.expected, 1.0)
            column, row, completeness = fit.column, fit.row, fit.visible
            # The less there is of it, the more the pixels on its edges count.
            room = 1.0 / math.sqrt(max(fit.visible, LEAST_VISIBLE))
            least, most = 1.0 - (1.0 - least) * room, 1.0 + (most - 1.0) * room
            if min(fit.ends, fit.sides) < LEAST_EDGES or fit.visible < LEAST_VISIBLE:
                share = 0.0
            azimuth_factor = 1.0 / math.sqrt(max(fit.ends, LEAST_EDGES))
            z_factor = 1.0 / math.sqrt(max(fit.sides, LEAST_EDGES))
    if count < 4 or share < least or share > most:
        return Detection(HIDDEN, math.nan, math.nan, share, completeness, 1.0, 1.0)
    a, b = plane_of_pixel(setup.camera, column, row)
    azimuth, z = solve_band(setup.camera, setup.body, a, b, band)
    if not (math.isfinite(azimuth) and math.isfinite(z)):
        return Detection(HIDDEN, math.nan, math.nan, share, completeness, 1.0, 1.0)
    return Detection(outcome, azimuth, z, share, completeness, azimuth_factor, z_factor)
