"""Looking for markers that are not known yet, along the cable that has been laid."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.camera.compiled import compiled
from marker_tracker_node.camera.pinhole import pixel_of_plane, plane_of_point
from marker_tracker_node.detection.band import surface_point
from marker_tracker_node.tracking.band_measurement import (
    HIDDEN,
    MEASURED,
    NEW_AREA,
    in_picture,
    measure,
    share_between,
)
from marker_tracker_node.tracking.gate_prediction import aim, neighbours, seen_height
from marker_tracker_node.tracking.state import (
    AREA,
    C_AREA,
    C_FIRST,
    C_HEIGHT,
    C_HITS,
    C_LAST,
    C_START,
    C_THETA,
    CABLE,
    CANDIDATES,
    GAP,
    HALF_BAND,
    HEIGHT,
    RECENT,
    REFERENCE,
    RHO,
    SEARCH,
    SHIFT,
    STATUS,
    THETA,
    USABLE,
    VAR_HEIGHT,
    VAR_THETA,
    WEIGHT,
)

FloatArray = NDArray[np.float64]
ByteArray = NDArray[np.uint8]

MAX_NODES = 2048
# A search looks at one pixel in this length [m].
SEARCH_GRAIN = 0.24e-3
PEAKS = 3
LEAST_PEAK = 0.35
P0_REACH = 0.45
# A marker proves itself on the free span, this far before it lands [rad].
APPROACH = 0.25
SAME_PLACE = 0.035
PROOF_HITS = 3
PROOF_ADVANCE = 0.1
# A gap of this many expected ones or more hides a marker that was missed.
SKIP = 0.4
FIRST_SIGMA_THETA = 4.0e-3
FIRST_SIGMA_HEIGHT = 1.0e-4


@compiled
def search(
    frame: ByteArray,
    table: ByteArray,
    view: FloatArray,
    config: FloatArray,
    shared: FloatArray,
    marks: FloatArray,
    candidates: FloatArray,
    path: FloatArray,
    gates: FloatArray,
    known: int,
    angle: float,
) -> None:  # pragma: no cover
    """Look where unknown markers may be; whoever moves with the cylinder becomes known.

    Args:
        frame: Shape (rows, columns, 3).
        table: See `gate_moments`.
        view: See `PinholeCamera.numbers`.
        config: See `TrackerConfig.numbers`.
        shared: See `state`.
        marks: See `state`.
        candidates: See `state`.
        path: See `TrackerState.path`.
        gates: See `GATE_SIZE`: the known markers in sight; one more row is free for work.
        known: How many of them.
        angle: Cylinder angle [rad].
    """
    count = marks.shape[0]
    turned = angle + shared[SHIFT]
    if marks[0, STATUS] == 0.0:
        _scan_range(
            frame, table, view, config, shared, marks, candidates, path, gates, known, turned,
            -P0_REACH, P0_REACH,
        )  # fmt: skip
    else:
        last = 0
        for n in range(1, count):
            if marks[n, STATUS] > 0.0:
                if n - last > 1:
                    gap = (marks[n, THETA] - marks[last, THETA]) / (n - last)
                    _scan_range(
                        frame, table, view, config, shared, marks, candidates, path, gates,
                        known, turned, marks[last, THETA] + 0.4 * gap, marks[n, THETA] - 0.4 * gap,
                    )  # fmt: skip
                last = n
        if last < count - 1:
            _scan_range(
                frame, table, view, config, shared, marks, candidates, path, gates, known, turned,
                marks[last, THETA] + 0.6 * usual_gap(config, marks, last), turned + APPROACH,
            )  # fmt: skip
    _promote(config, shared, marks, candidates)


@compiled
def usual_gap(config: FloatArray, marks: FloatArray, last: int) -> float:  # pragma: no cover
    """Return the wound angle between markers [rad]: measured so far, or else expected."""
    if last > 0:
        return float((marks[last, THETA] - marks[0, THETA]) / last)
    return float(config[GAP])


@compiled
def slot_of(config: FloatArray, marks: FloatArray, theta: float) -> int:  # pragma: no cover
    """Return the number of a marker found at a wound angle [rad], or -1 if there is none."""
    count = marks.shape[0]
    if marks[0, STATUS] == 0.0:
        return 0 if abs(theta) < P0_REACH else -1
    below, above = 0, -1
    for n in range(count):
        if marks[n, STATUS] > 0.0:
            if marks[n, THETA] <= theta:
                below = n
            elif above < 0:
                above = n
    if theta < marks[0, THETA]:
        return -1
    if above < 0:
        ratio = (theta - marks[below, THETA]) / usual_gap(config, marks, below)
        number = below + max(int(math.floor(ratio + SKIP)), 1)  # noqa: RUF046
        return number if number < count else -1
    free = above - below - 1
    if free < 1:
        return -1
    share = (theta - marks[below, THETA]) / (marks[above, THETA] - marks[below, THETA])
    number = below + int(round(share * (above - below)))  # noqa: RUF046
    return min(max(number, below + 1), above - 1)


@compiled
def _scan_range(
    frame: ByteArray,
    table: ByteArray,
    view: FloatArray,
    config: FloatArray,
    shared: FloatArray,
    marks: FloatArray,
    candidates: FloatArray,
    path: FloatArray,
    gates: FloatArray,
    known: int,
    turned: float,
    first: float,
    last: float,
) -> None:  # pragma: no cover
    """Scan the visible part of every turn between two wound angles."""
    turn = 2.0 * math.pi
    lap = 0
    while turned - lap * turn + config[USABLE] >= first:
        low = max(first, turned - lap * turn - config[USABLE])
        high = min(last, turned - lap * turn + config[USABLE])
        if high > low:
            _scan_turn(
                frame, table, view, config, shared, marks, candidates, path, gates, known, turned,
                low, high,
            )  # fmt: skip
        lap += 1


@compiled
def _scan_turn(
    frame: ByteArray,
    table: ByteArray,
    view: FloatArray,
    config: FloatArray,
    shared: FloatArray,
    marks: FloatArray,
    candidates: FloatArray,
    path: FloatArray,
    gates: FloatArray,
    known: int,
    turned: float,
    first: float,
    last: float,
) -> None:  # pragma: no cover
    """Count marker pixels along one stretch of cable and examine where they gather."""
    rows, columns = frame.shape[:2]
    rho, r = config[RHO], config[CABLE]
    scale = view[12] / (abs(view[9]) * view[23])
    stride = max(int(scale * SEARCH_GRAIN), 1)
    step = stride / (scale * rho)
    nodes = min(int((last - first) / step) + 1, MAX_NODES)
    counts = np.zeros(nodes)
    offsets = np.zeros(nodes)
    reach = config[SEARCH] * scale
    for k in range(nodes):
        theta = first + k * step
        height, slope = seen_height(shared, marks, path, theta)
        x, y, z = surface_point(rho, r, turned - theta, height, slope, 0.0)
        a, b, _depth = plane_of_point(view, x, y, z)
        column, row = pixel_of_plane(view, a, b)
        v = int(round(row))  # noqa: RUF046
        if not 0 <= v < rows:
            continue
        left = max(math.ceil(column - reach), 0)
        right = min(math.floor(column + reach), columns - 1)
        for u in range(left, right + 1, stride):
            index = (
                ((frame[v, u, 0] >> 3) << 10) | ((frame[v, u, 1] >> 3) << 5) | (frame[v, u, 2] >> 3)
            )
            if table[index] and not _claimed(gates, known, float(u), float(v)):
                counts[k] += 1.0
                offsets[k] += u - column
    width = max(int(2.0 * config[HALF_BAND] / (rho * step)), 1)
    least = LEAST_PEAK * 4.0 * config[HALF_BAND] * r * scale * scale / (stride * stride)
    for _ in range(PEAKS):
        place, best = _fullest(counts, width)
        if best < least:
            return
        end = min(place + width, nodes)
        theta = first + 0.5 * (place + end) * step
        shift = offsets[place:end].sum() / best / scale
        counts[place:end] = 0.0
        offsets[place:end] = 0.0
        _examine(
            frame, table, view, config, shared, marks, candidates, path, gates, known, turned,
            theta, shift,
        )  # fmt: skip


@compiled
def _fullest(counts: FloatArray, width: int) -> tuple[int, float]:  # pragma: no cover
    """Return where the stretch of a given width that holds most begins, and what it holds."""
    total, best, place = counts[:width].sum(), 0.0, 0
    for k in range(counts.size):
        if total > best:
            best, place = total, k
        total -= counts[k]
        if k + width < counts.size:
            total += counts[k + width]
    return place, best


@compiled
def _claimed(gates: FloatArray, known: int, u: float, v: float) -> bool:  # pragma: no cover
    for n in range(known):
        du, dv = u - gates[n, 0], v - gates[n, 1]
        across = gates[n, 2] * dv - gates[n, 3] * du
        along = du * gates[n, 2] + dv * gates[n, 3]
        if -gates[n, 8] <= along <= gates[n, 4] and gates[n, 5] <= across <= gates[n, 6]:
            return True
    return False


@compiled
def _examine(
    frame: ByteArray,
    table: ByteArray,
    view: FloatArray,
    config: FloatArray,
    shared: FloatArray,
    marks: FloatArray,
    candidates: FloatArray,
    path: FloatArray,
    gates: FloatArray,
    known: int,
    turned: float,
    theta: float,
    shift: float,
) -> None:  # pragma: no cover
    """Measure a gathering of marker pixels as a band and remember it if it is one."""
    rows, columns = frame.shape[:2]
    height, slope = seen_height(shared, marks, path, theta)
    z = height + shift
    share = 0.0
    beside = np.empty(4)
    for step in range(3):
        azimuth = turned - theta
        neighbours(config, shared, marks, path, azimuth, theta, z, slope, beside)
        expected = aim(view, config, azimuth, z, slope, beside, gates[known])
        if step == 0:
            # The first look may be half a band off.
            gates[known, 4] *= 1.3
            gates[known, 8] *= 1.3
        if in_picture(view, config, gates[known], rows, columns) != HIDDEN:
            return
        for n in range(known):
            share_between(gates, n, known)
        came, found, seen, share = measure(
            frame,
            table,
            view,
            config,
            gates[known],
            expected,
            azimuth,
            z,
            slope,
            beside,
            NEW_AREA,
        )
        if came != MEASURED:
            return
        theta, z = turned - found, seen
    expected_z = seen_height(shared, marks, path, theta)[0]
    if abs(turned - theta) > 40.0 * math.pi or abs(z - expected_z) > config[SEARCH]:
        return
    if theta > turned + APPROACH or slot_of(config, marks, theta) < 0:
        return
    _remember(candidates, theta, z, share, turned)


@compiled
def _remember(
    candidates: FloatArray, theta: float, z: float, share: float, turned: float
) -> None:  # pragma: no cover
    oldest = 0
    for c in range(CANDIDATES):
        if candidates[c, C_HITS] > 0.0 and abs(candidates[c, C_FIRST] - theta) < SAME_PLACE:
            candidates[c, C_HITS] += 1.0
            part = 1.0 / candidates[c, C_HITS]
            candidates[c, C_THETA] += part * (theta - candidates[c, C_THETA])
            candidates[c, C_HEIGHT] += part * (z - candidates[c, C_HEIGHT])
            candidates[c, C_AREA] += part * (share - candidates[c, C_AREA])
            candidates[c, C_LAST] = turned
            return
        if candidates[c, C_LAST] < candidates[oldest, C_LAST]:
            oldest = c
        if candidates[c, C_HITS] == 0.0:
            oldest = c
            break
    candidates[oldest] = 0.0
    candidates[oldest, C_FIRST] = theta
    candidates[oldest, C_THETA] = theta
    candidates[oldest, C_HEIGHT] = z
    candidates[oldest, C_AREA] = share
    candidates[oldest, C_HITS] = 1.0
    candidates[oldest, C_START] = turned
    candidates[oldest, C_LAST] = turned


@compiled
def _promote(
    config: FloatArray, shared: FloatArray, marks: FloatArray, candidates: FloatArray
) -> None:  # pragma: no cover
    """Make markers of the candidates that have moved with the cylinder."""
    for c in range(CANDIDATES):
        if candidates[c, C_HITS] < PROOF_HITS:
            continue
        slot = slot_of(config, marks, candidates[c, C_THETA])
        if slot < 0 or marks[slot, STATUS] > 0.0:
            candidates[c] = 0.0
            continue
        if slot > 0 and candidates[c, C_LAST] - candidates[c, C_START] < PROOF_ADVANCE:
            continue
        if slot == 0:
            # Wound angles count from P0, wherever camera and encoder think that it is.
            shared[SHIFT] -= candidates[c, C_THETA]
            candidates[c, C_THETA] = 0.0
        marks[slot] = 0.0
        marks[slot, STATUS] = 1.0
        marks[slot, THETA] = candidates[c, C_THETA]
        marks[slot, HEIGHT] = candidates[c, C_HEIGHT]
        marks[slot, AREA] = candidates[c, C_AREA]
        marks[slot, RECENT] = candidates[c, C_THETA]
        marks[slot, REFERENCE] = candidates[c, C_THETA]
        marks[slot, WEIGHT] = 1.0
        marks[slot, VAR_THETA] = FIRST_SIGMA_THETA**2
        marks[slot, VAR_HEIGHT] = FIRST_SIGMA_HEIGHT**2
        candidates[c] = 0.0
