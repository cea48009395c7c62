"""The free span: its angle, where it lands, and how long it is."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.lay.row_measurement import PLACE, SIGMA, Z

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class FreeSpan:
    """The straight cable before the contact line, in one instant.

    Attributes:
        angle: Of the cable against the plane across the axis, positive towards +z [rad].
        sigma_angle: One standard deviation, the camera's roll aside [rad].
        contact_z: Where it lands [m].
        sigma_contact_z: One standard deviation [m].
        rows: That were used.
    """

    angle: float
    sigma_angle: float
    contact_z: float
    sigma_contact_z: float
    rows: int

    @property
    def slope(self) -> float:
        """Dz per way towards the guide."""
        return math.tan(self.angle)


def sightings_near(found: list[FloatArray], start: float, slope: float, limit: float) -> FloatArray:
    """Return way, z and sigma [m] of what each row shows nearest to a line, shape (n, 3).

    Args:
        found: Of each row of the free span, see `turns_in_row`.
        start: z of the line at the contact [m].
        slope: Its dz per way.
        limit: Farthest from it [m].
    """
    seen = []
    for turns in found:
        off = np.abs(turns[:, Z] - start - slope * turns[:, PLACE])
        if off.size and off.min() < limit:
            seen.append(turns[int(np.argmin(off)), [PLACE, Z, SIGMA]])
    return np.array(seen).reshape(-1, 3)


def towards_guide(
    found: list[FloatArray], guide_z: float, free_length: float, limit: float, onward: float
) -> float:
    """Return where a straight cable to the guide lands that most rows show [m].

    Args:
        found: Of each row of the free span, see `turns_in_row`.
        guide_z: [m]
        free_length: Expected [m].
        limit: How far rows may be off it [m].
        onward: 1 where the winding goes towards +z, -1 otherwise; dimensionless.

    Returns:
        nan where fewer than three rows, or less than half of them, agree.
    """
    best, start = max(3, (len(found) + 1) // 2) - 1, math.nan
    # Of lines that as many rows show, older turns among them, the newest lies farthest along.
    for way, z in sorted(found[0][:, [PLACE, Z]], key=lambda one: -onward * float(one[1])):
        if onward * z > onward * guide_z + limit:
            continue
        slope = (guide_z - z) / (free_length - way)
        landing = z - slope * way
        agreeing = len(sightings_near(found, landing, slope, limit))
        if agreeing > best:
            best, start = agreeing, float(landing)
    return start


def fit_span(ways: FloatArray, z: FloatArray, sigma: FloatArray, floor: float) -> FreeSpan | None:
    """Return the straight line through sightings of the free cable; None for fewer than three.

    Sightings that are off by more than three times the usual are left out.

    Args:
        ways: Before the contact line [m], shape (n,).
        z: [m], shape (n,).
        sigma: Of z [m], shape (n,).
        floor: Error that all sightings share [m].
    """
    used = np.ones(ways.size, dtype=bool)
    for _ in range(4):
        if used.sum() < 3:
            return None
        weight = 1.0 / sigma[used] ** 2
        x, y = ways[used], z[used]
        mean_x, mean_y = np.average(x, weights=weight), np.average(y, weights=weight)
        spread = float((weight * (x - mean_x) ** 2).sum())
        if spread <= 0.0:
            return None
        slope = float((weight * (x - mean_x) * (y - mean_y)).sum() / spread)
        start = float(mean_y - slope * mean_x)
        off = np.abs(z - start - slope * ways)
        limit = 3.0 * max(1.5 * float(np.median(off[used])), float(np.median(sigma)))
        kept = off <= limit
        if (kept == used).all():
            break
        used = kept
    else:
        if used.sum() < 3:
            return None
    count = int(used.sum())
    scatter = float((weight * (y - start - slope * x) ** 2).sum()) / max(count - 2, 1)
    factor = max(scatter, 1.0)
    return FreeSpan(
        angle=math.atan(slope),
        sigma_angle=math.sqrt(factor / spread) / (1.0 + slope * slope),
        contact_z=start,
        sigma_contact_z=math.hypot(
            math.sqrt(factor * (1.0 / float(weight.sum()) + mean_x**2 / spread)), floor
        ),
        rows=count,
    )


class FreeLength:
    """The length of the free span from its angles and the guide's places, over a run.

    tan(angle) = (guide z - contact z) / length + roll of the camera.
    """

    def __init__(self, roll_doubt: float) -> None:
        """Start without sightings.

        Args:
            roll_doubt: How far the picture may be turned [rad].
        """
        self._normal = np.diag([0.0, 1.0 / roll_doubt**2])
        self._right = np.zeros(2)

    def add(self, span: FreeSpan, guide_z: float) -> None:
        """Take the span in an instant.

        Args:
            span: As measured.
            guide_z: Where the guide stands [m].
        """
        row = np.array([guide_z - span.contact_z, 1.0])
        weight = 1.0 / span.sigma_angle**2
        self._normal += weight * np.outer(row, row)
        self._right += weight * row * span.slope

    @property
    def value(self) -> tuple[float, float]:
        """Length and its standard deviation [m], nan while the guide has hardly moved."""
        if self._normal[0, 0] <= 0.0:
            return math.nan, math.nan
        covariance = np.linalg.pinv(self._normal)
        inverse = float((covariance @ self._right)[0])
        sigma = math.sqrt(max(float(covariance[0, 0]), 0.0))
        if inverse <= 3.0 * sigma:
            return math.nan, math.nan
        return 1.0 / inverse, sigma / inverse**2
