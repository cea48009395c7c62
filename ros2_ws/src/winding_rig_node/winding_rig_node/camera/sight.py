"""Which part of the cable can show in the window, without projecting it."""

from __future__ import annotations

import math
from typing import NamedTuple

from winding_core.compiling import called
from winding_rig_node.camera.optics import Lens

# A section whose azimuth has a smaller cosine stands behind the cylinder.
HIDDEN_COSINE = -0.25


class RayRange(NamedTuple):
    """Least and greatest dy/dx and dz/dx of the rays through the window, in the lab frame."""

    y_low: float
    y_high: float
    z_low: float
    z_high: float


class Sight(NamedTuple):
    """Where the centre line must run to show in the window.

    Attributes:
        first_azimuth: On the cylinder [rad].
        last_azimuth: On the cylinder [rad].
        y_low: On the free span [m].
        y_high: On the free span [m].
        z_low: [m]
        z_high: [m]
    """

    first_azimuth: float
    last_azimuth: float
    y_low: float
    y_high: float
    z_low: float
    z_high: float


@called
def sight_of(lens: Lens, rays: RayRange, rho: float, room: float) -> Sight:  # pragma: no cover
    """Return where a centre line at the radius rho [m] can show.

    Args:
        lens: The camera.
        rays: Through its window.
        rho: Radius of the centre line [m].
        room: Farthest that what is drawn of a section lies from the centre line [m].
    """
    back, front = lens.x - rho * HIDDEN_COSINE + room, lens.x - rho - room
    y_low, y_high = -math.inf, math.inf
    z_low, z_high = -math.inf, math.inf
    if front > 0.0:
        # Rays run towards -x: what they gain per metre towards the cable is minus the slope.
        y_low = lens.y - max(front * rays.y_high, back * rays.y_high) - room
        y_high = lens.y - min(front * rays.y_low, back * rays.y_low) + room
        z_low = lens.z - max(front * rays.z_high, back * rays.z_high) - room
        z_high = lens.z - min(front * rays.z_low, back * rays.z_low) + room
    hidden = math.acos(HIDDEN_COSINE)
    first, last = -hidden, hidden
    # Beyond a quarter turn y falls again: a part that comes back before it is hidden counts.
    if rho * math.sin(hidden) > y_high > -rho:
        last = math.asin(y_high / rho)
    if -rho * math.sin(hidden) < y_low < rho:
        first = math.asin(y_low / rho)
    return Sight(first, last, y_low, y_high, z_low, z_high)
