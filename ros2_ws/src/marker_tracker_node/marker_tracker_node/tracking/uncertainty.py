"""What a measured band may be wrong by, from what random scenes of the simulated camera showed."""

from __future__ import annotations

import math

from marker_tracker_node.camera.pinhole import pixels_per_metre
from marker_tracker_node.detection.band import Body
from marker_tracker_node.tracking.state import Setup
from winding_core.compiling import called

# One standard deviation of a band's middle in one frame [px]: the mask's bias, which depends on
# light, colour and azimuth and is the same in the next frame, and what differs between frames.
BIAS = 0.09
SCATTER = 0.05
# Where a neighbouring turn cuts a band off [px], and of a turn's place that is only expected.
CUT = 0.12
# Of z, where a thick cable is bent sharply: in so many r^2 / (R + r), r and R + r the radii of the
# cable and of its bend.
BENT = 0.045
# What a run leaves of that, whose share of a band depends on its azimuth.
BENT_OVER_RUN = 0.5
# What of the bias is left over a run, in which a band is seen under every azimuth, along the cable
# and across it [px].
MEAN_BIAS_ALONG, MEAN_BIAS_ACROSS = 0.06, 0.06
# A band is an ellipse from the side; nearer to the limb than this its scale changes no more.
LEAST_FACING = 0.3


@called
def pixel_size(setup: Setup, azimuth: float) -> tuple[float, float]:  # pragma: no cover
    """Return the angle [rad] and the height [m] that a pixel covers at a band's azimuth."""
    rho = setup.body.rho
    facing = math.cos(azimuth)
    height = 1.0 / pixels_per_metre(setup.camera, abs(setup.camera.x) - rho * facing)
    return height / (rho * max(facing, LEAST_FACING)), height


@called
def frame_variance(cut: bool) -> float:  # pragma: no cover
    """Return the variance of a band's middle in one frame that no frame tells [px^2]."""
    return BIAS**2 + (CUT**2 if cut else 0.0)


@called
def bent_height(body: Body) -> float:  # pragma: no cover
    """Return one deviation of z that a thick cable's bend adds in one frame, at any scale [m]."""
    return BENT * body.cable_radius * body.cable_radius / body.rho
