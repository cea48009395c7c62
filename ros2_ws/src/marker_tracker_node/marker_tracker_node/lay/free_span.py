"""The free span: its angle, where it lands, and how long it is."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.lay.config import Machine
from marker_tracker_node.lay.row_measurement import PLACE, SIGMA, Z, median
from winding_core.compiling import called

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]


# Angles of so many looks err alike: the span lies on the same pixels. No picture's scale along the
# span is known better than by this share.
ALIKE, SCALE_DOUBT = 4.0, 0.003
# A span that moves by less than a pixel over its rows looks steeper or less steep than it is: how
# far angles so far apart as those of a run err differently [rad].
TREND = 1.0e-4


class FreeSpan(NamedTuple):
    """The straight cable before the contact line, in one instant."""

    angle: float  # Of the cable against the plane across the axis, positive towards +z [rad]
    sigma_angle: float  # One standard deviation, the camera's roll aside [rad]
    contact_z: float  # Where it lands [m]
    sigma_contact_z: float  # One standard deviation [m]
    rows: int  # That were used; 0 where there is no span

    @property
    def slope(self) -> float:
        """Dz per way towards the guide."""
        return math.tan(self.angle)


NO_SPAN = FreeSpan(math.nan, math.nan, math.nan, math.nan, 0)


@called
def nearest_in_row(
    found: FloatArray, count: int, start: float, slope: float, limit: float
) -> int:  # pragma: no cover
    """Return which turn of a row lies nearest to a line, -1 where none does.

    Args:
        found: Of the row, see `measure_row`.
        count: How many there are.
        start: z of the line at the contact [m].
        slope: Its dz per way.
        limit: Farthest from it [m].
    """
    nearest, least = -1, limit
    for k in range(count):
        off = abs(found[k, Z] - start - slope * found[k, PLACE])
        if off < least:
            nearest, least = k, off
    return nearest


@called
def sightings_near(
    found: FloatArray,
    counts: IndexArray,
    start: float,
    slope: float,
    limit: float,
    seen: FloatArray,
) -> int:  # pragma: no cover
    """Write way, z and sigma [m] of what each row shows nearest to a line; return their number.

    Args:
        found: Of each row of the free span, see `measure_row`; shape (rows, n, 7).
        counts: Turns in each row, shape (rows,).
        start: z of the line at the contact [m].
        slope: Its dz per way.
        limit: Farthest from it [m].
        seen: To be written, shape (3, rows).
    """
    number = 0
    for row in range(counts.size):
        k = nearest_in_row(found[row], counts[row], start, slope, limit)
        if k >= 0:
            seen[0, number] = found[row, k, PLACE]
            seen[1, number] = found[row, k, Z]
            seen[2, number] = found[row, k, SIGMA]
            number += 1
    return number


@called
def towards_guide(
    found: FloatArray,
    counts: IndexArray,
    guide_z: float,
    last: float,
    reach: float,
    limit: float,
    machine: Machine,
) -> float:  # pragma: no cover
    """Return where a straight cable to the guide lands that most rows show [m].

    Args:
        found: Of each row of the free span, see `measure_row`; shape (rows, n, 7).
        counts: Turns in each row, shape (rows,).
        guide_z: [m]
        last: Where the cable landed when that was known [m].
        reach: How far from there it may land [m].
        limit: How far rows may be off it [m].
        machine: Cylinder and cable.

    Returns:
        nan where fewer than three rows, or less than half of them, agree.
    """
    best, farthest, start = max(3, (counts.size + 1) // 2), -math.inf, math.nan
    for k in range(counts[0]):
        way, z = found[0, k, PLACE], found[0, k, Z]
        slope = (guide_z - z) / (machine.free_length - way)
        landing = z - slope * way
        if abs(landing - last) > reach:
            continue
        agreeing = 0
        for row in range(counts.size):
            agreeing += nearest_in_row(found[row], counts[row], landing, slope, limit) >= 0
        # Of lines that as many rows show, older turns among them, the newest lies farthest along.
        if agreeing > best or (agreeing == best and machine.onward * z > farthest):
            best, farthest, start = agreeing, machine.onward * z, landing
    return start


@called
def fit_span(
    ways: FloatArray, z: FloatArray, sigma: FloatArray, floor: float
) -> FreeSpan:  # pragma: no cover
    """Return the straight line through sightings of the free cable; NO_SPAN for fewer than three.

    Sightings that are off by more than three times the usual are left out.

    Args:
        ways: Before the contact line [m], shape (n,).
        z: [m], shape (n,).
        sigma: Of z [m], shape (n,).
        floor: Error that all sightings share [m].
    """
    size = ways.size
    if size < 3:
        return NO_SPAN
    used, weights = np.empty(size, dtype=np.bool_), np.empty(size)
    off, some = np.empty(size), np.empty(size)
    for k in range(size):
        used[k] = True
        weights[k] = 1.0 / sigma[k] ** 2
        some[k] = sigma[k]
    usual_sigma = median(some, size)
    for _ in range(4):
        count, total, mean_x, mean_y = 0, 0.0, 0.0, 0.0
        for k in range(size):
            if used[k]:
                count += 1
                total += weights[k]
                mean_x += weights[k] * ways[k]
                mean_y += weights[k] * z[k]
        if count < 3:
            return NO_SPAN
        mean_x /= total
        mean_y /= total
        spread, slope = 0.0, 0.0
        for k in range(size):
            if used[k]:
                spread += weights[k] * (ways[k] - mean_x) ** 2
                slope += weights[k] * (ways[k] - mean_x) * (z[k] - mean_y)
        if spread <= 0.0:
            return NO_SPAN
        slope /= spread
        start = mean_y - slope * mean_x
        scatter, number = 0.0, 0
        for k in range(size):
            off[k] = abs(z[k] - start - slope * ways[k])
            if used[k]:
                scatter += weights[k] * off[k] ** 2
                some[number] = off[k]
                number += 1
        limit = 3.0 * max(1.5 * median(some, number), usual_sigma)
        changed, kept = False, 0
        for k in range(size):
            changed = changed or used[k] != (off[k] <= limit)
            used[k] = off[k] <= limit
            kept += used[k]
        if not changed:
            break
    if kept < 3:
        return NO_SPAN
    factor = max(scatter / max(count - 2, 1), 1.0)
    return FreeSpan(
        math.atan(slope),
        math.sqrt(factor / spread) / (1.0 + slope * slope),
        start,
        math.hypot(math.sqrt(factor * (1.0 / total + mean_x**2 / spread)), floor),
        count,
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
        self._roll = 1.0 / roll_doubt**2
        self._normal = np.diag([0.0, self._roll])
        self._right = np.zeros(2)

    def add(self, span: FreeSpan, guide_z: float) -> None:
        """Take the span in an instant."""
        row = np.array([guide_z - span.contact_z, 1.0])
        weight = 1.0 / (ALIKE * span.sigma_angle**2)
        self._normal += weight * np.outer(row, row)
        self._right += weight * row * span.slope

    @property
    def value(self) -> tuple[float, float]:
        """Length and its standard deviation [m], nan while the guide has hardly moved."""
        if self._normal[0, 0] <= 0.0:
            return math.nan, math.nan
        covariance = np.linalg.pinv(self._normal)
        inverse = float((covariance @ self._right)[0])
        weight = float(self._normal[1, 1]) - self._roll
        spread = float(self._normal[0, 0] / weight - (self._normal[0, 1] / weight) ** 2)
        trend = TREND**2 / spread if spread > 0.0 else math.inf
        sigma = math.sqrt(max(float(covariance[0, 0]), 0.0) + trend)
        if inverse <= 3.0 * sigma:
            return math.nan, math.nan
        return 1.0 / inverse, math.hypot(sigma / inverse, SCALE_DOUBT) / inverse
