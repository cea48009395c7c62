"""Measuring one band in its gate."""

from __future__ import annotations

import math

from marker_tracker_node.camera.pinhole import plane_of_pixel
from marker_tracker_node.detection.band import Band, solve_band
from marker_tracker_node.detection.gate import Gates, Picture, gate_moments
from marker_tracker_node.tracking.gate_prediction import HIDDEN, MEASURED
from marker_tracker_node.tracking.state import Setup
from winding_core.compiling import called

# Share of the expected area within which a gathering of pixels may be a new band, and within
# which a known band is whole: one that is covered in part would be measured beside its middle.
NEW_AREA = (0.7, 1.4)
WHOLE_AREA = (0.87, 1.2)


@called
def measure_band(
    picture: Picture,
    setup: Setup,
    gates: Gates,
    n: int,
    band: Band,
    expected: float,
    limits: tuple[float, float],
) -> tuple[int, float, float, float]:  # pragma: no cover
    """Return the outcome, azimuth [rad], z [m] and measured over expected area.

    Args:
        picture: Frame and colours.
        setup: Machine and camera.
        gates: Where to look.
        n: Which of them.
        band: As expected.
        expected: Pixels that the band should fill times its usual share of them.
        limits: Least and most accepted share of the expected area.
    """
    least, most = limits
    count, column, row = gate_moments(picture, gates, n)
    share = count / max(expected, 1.0)
    if count < 4 or share < least or share > most:
        return HIDDEN, math.nan, math.nan, share
    a, b = plane_of_pixel(setup.camera, column, row)
    azimuth, z = solve_band(setup.camera, setup.body, a, b, band)
    if not (math.isfinite(azimuth) and math.isfinite(z)):
        return HIDDEN, math.nan, math.nan, share
    return MEASURED, azimuth, z, share
