"""Markers that are not known yet: sought along the laid cable, measured, confirmed, numbered."""

from __future__ import annotations

import math

import numpy as np

from marker_tracker_node.arrays import FloatArray, IndexArray
from marker_tracker_node.camera.pinhole import pixel_of_plane, plane_of_point
from marker_tracker_node.detection.band import surface_point
from marker_tracker_node.detection.colour_band import NEW_AREA, WHOLE_AREA
from marker_tracker_node.detection.detectors import measure_mark
from marker_tracker_node.detection.gate import (
    ANY,
    COVERED,
    FIRST_COLOUR,
    HIDDEN,
    MEASURED,
    NO_IDENTITY,
    PARTLY,
    TABLE_SIZE,
    Gates,
    Picture,
    gate_moments,
    gate_visibility,
    in_gate,
    seeking,
    several_colours,
    table_index,
)
from marker_tracker_node.tracking.frame.expected_bands import Scan
from marker_tracker_node.tracking.frame.gate_prediction import (
    axis_scale,
    gate_margin,
    predict_gate,
    separate_gates,
    turned_since,
)
from marker_tracker_node.tracking.frame.laid_path import (
    APPROACH,
    BAND_REACH,
    LEAST_GAP,
    PROOF_ADVANCE,
    PROOF_HITS,
    band_beside_turns,
    corrected_height,
    first_sought,
    known_around,
    lift_at,
    mean_gap,
    search_reach,
)
from marker_tracker_node.tracking.frame.run_means import BIAS, whole_share
from marker_tracker_node.tracking.state import CANDIDATES, Candidates, Marks, Setup
from winding_core.compiling import called

# Before any offset is known, what lands may lie so much farther from the path than what has come
# round, in the reach of a search: that would have been found as it landed.
LANDING = 0.2


@called
def marker_number(
    setup: Setup, marks: Marks, colour_of: IndexArray, theta: float, colour: int, identity: int
) -> int:  # pragma: no cover
    """Return the number of a marker found at a wound angle [rad], or -1 if there is none.

    Among markers of several colours the nearest of its colour is meant: one of a colour of its
    own is known by that alone. A mark that names its marker is that one, if the order of winding
    allows it, and else no marker.
    """
    count = marks.known.size
    if not marks.known[0]:
        first = colour == colour_of[0] and identity in (NO_IDENTITY, 0)
        return 0 if abs(theta) < BAND_REACH and first else -1
    below, above = known_around(marks, theta)
    if theta < marks.theta[0]:
        return -1
    if above < 0:
        ratio = (theta - marks.theta[below]) / mean_gap(setup, marks, below)
        # The first may lie anywhere in its gap; then markers are no nearer than the least one.
        number = below + max(int(math.floor(ratio + 1.0 - LEAST_GAP)), 1)  # noqa: RUF046
        above = count
    else:
        share = (theta - marks.theta[below]) / (marks.theta[above] - marks.theta[below])
        number = below + int(round(share * (above - below)))  # noqa: RUF046
        number = min(max(number, below + 1), above - 1)
    if identity != NO_IDENTITY:
        return identity if below < identity < above else -1
    if below < number < above and colour_of[number] == colour:
        return number
    best = -1
    for n in range(below + 1, above):
        if colour_of[n] == colour and (best < 0 or abs(n - number) < abs(best - number)):
            best = n
    return best


@called
def verify_candidate(scan: Scan, theta: float, shift: float) -> None:  # pragma: no cover
    """Measure a gathering of marker pixels as a band and remember it if it is one.

    It lies at a wound angle [rad], shifted along z from the cable's middle [m].
    """
    setup, gates, turned = scan.setup, scan.gates, scan.turned
    work = scan.expected.outcome.size
    height, slope = corrected_height(scan.cable, theta)
    z = height + shift
    share, colour, identity = 0.0, FIRST_COLOUR, NO_IDENTITY
    for step in range(PROOF_HITS):
        late = turned_since(setup, scan.shutter, turned - theta, z)
        band = band_beside_turns(setup, scan.cable, turned + late - theta, theta, z, slope)
        expected = predict_gate(setup, band, gates, work)
        if step == 0:
            # The first look may be half a band off.
            gates.ahead[work] *= 1.3
            gates.behind[work] *= 1.3
        if gate_visibility(gates, work, gate_margin(setup), scan.picture) != HIDDEN:
            return
        for n in range(work):
            if scan.expected.outcome[n] > COVERED:
                separate_gates(gates, n, work)
        colour = _colour_in_gate(scan.picture, gates, work)
        found = measure_mark(
            setup.detector, seeking(scan.picture, colour), setup.camera, setup.body, gates, work,
            band, expected, 1.0, whole_share(scan.cable.marks), NEW_AREA,
        )  # fmt: skip
        if found.outcome == HIDDEN:
            return
        azimuth, z, share, identity = found.azimuth, found.z, found.share, found.identity
        theta = turned + turned_since(setup, scan.shutter, azimuth, z) - azimuth
    beside = abs(z - corrected_height(scan.cable, theta)[0])
    marks, colour_of = scan.cable.marks, scan.picture.colour_of
    if (
        theta - turned <= APPROACH
        and beside <= search_reach(setup, marks, theta)
        and not _is_first(scan, theta, z)
        and not _lies_on_another_turn(scan, theta, z)
        and marker_number(setup, marks, colour_of, theta, colour, identity) >= 0
    ):
        _remember(scan, theta, z, share, colour, identity)


@called
def _colour_in_gate(picture: Picture, gates: Gates, n: int) -> int:  # pragma: no cover
    """Return the colour of markers that most pixels of gate n have."""
    best, most = FIRST_COLOUR, -1.0
    if several_colours(picture):
        for colour in range(FIRST_COLOUR, picture.tables.size // TABLE_SIZE):
            count = gate_moments(seeking(picture, colour), gates, n)[0]
            if count > most:
                best, most = colour, count
    return best


@called
def _is_first(scan: Scan, theta: float, z: float) -> bool:  # pragma: no cover
    """Return whether a band at a height [m] is P0 come round, not seen where it was expected."""
    marks = scan.cable.marks
    lap = round(theta / (math.tau))
    if lap == 0 or not marks.known[0] or scan.expected.outcome[0] in (MEASURED, PARTLY):
        return False
    away, beside = theta - math.tau * lap, z - marks.height[0]
    return bool(
        abs(away) < scan.setup.usable_azimuth and abs(beside) < 0.5 * scan.setup.body.cable_radius
    )


@called
def _lies_on_another_turn(scan: Scan, theta: float, z: float) -> bool:  # pragma: no cover
    """Return whether the turn before or after fits a band's height [m] better than its own."""
    off, last = _beside_path(scan, theta, z), scan.turned + scan.setup.usable_azimuth
    for lap in (-1.0, 1.0):
        other = theta + 2.0 * lap * math.pi
        if 0.0 <= other <= last and _beside_path(scan, other, z) < off:
            return True
    return False


@called
def _beside_path(scan: Scan, theta: float, z: float) -> float:  # pragma: no cover
    """Return how far from the path a height [m] is at a wound angle, in the reach of a search."""
    marks = scan.cable.marks
    off = abs(z - corrected_height(scan.cable, theta)[0])
    off /= search_reach(scan.setup, marks, theta)
    return off - LANDING if first_sought(marks) and theta > scan.turned - math.pi else off


@called
def _remember(
    scan: Scan, theta: float, z: float, share: float, colour: int, identity: int
) -> None:  # pragma: no cover
    """Add a sighting to the candidate of its place, or in place of the one seen longest ago.

    Beside P0 alone nothing is new that would have been seen to land: it is another marker, whose
    turn lies as far off as the guide stands behind.
    """
    candidates, turned, place, marks = scan.candidates, scan.turned, 0, scan.cable.marks
    late = first_sought(marks) and marks.found[0] < theta < turned - math.pi
    for c in range(CANDIDATES):
        other = candidates.identity[c]
        same = candidates.hits[c] > 0 and candidates.colour[c] == colour
        same = same and (identity in (NO_IDENTITY, other) or other == NO_IDENTITY)
        if (candidates.hits[c] == 0 and not late) or (
            same and abs(candidates.first[c] - theta) < scan.setup.slip_limit
        ):
            place = c
            break
        if candidates.last[c] < candidates.last[place]:
            place = c
    else:
        if late:
            return
        candidates.hits[place] = 0
    if candidates.hits[place] == 0:
        candidates.colour[place], candidates.identity[place] = colour, NO_IDENTITY
        candidates.first[place], candidates.start[place] = theta, turned
        candidates.theta[place] = candidates.height[place] = candidates.area[place] = 0.0
    candidates.hits[place] += 1
    part = 1.0 / candidates.hits[place]
    candidates.identity[place] = max(identity, candidates.identity[place])
    candidates.theta[place] += part * (theta - candidates.theta[place])
    candidates.height[place] += part * (z - candidates.height[place])
    candidates.area[place] += part * (share - candidates.area[place])
    candidates.last[place] = turned


@called
def confirm_candidates(
    setup: Setup, marks: Marks, candidates: Candidates, colour_of: IndexArray, shift: float
) -> float:  # pragma: no cover
    """Make markers of the candidates that moved with the cylinder; return the new shift [rad]."""
    for c in range(CANDIDATES):
        if candidates.hits[c] < PROOF_HITS:
            continue
        number = marker_number(
            setup, marks, colour_of, candidates.theta[c], candidates.colour[c],
            candidates.identity[c],
        )  # fmt: skip
        if number < 0 or marks.known[number]:
            candidates.hits[c] = 0
            continue
        if number > 0 and candidates.last[c] - candidates.start[c] < PROOF_ADVANCE:
            continue
        if number == 0:
            # Wound angles count from P0, wherever camera and encoder think that it is.
            shift -= candidates.theta[c]
            candidates.theta[c] = 0.0
        # Corrected numbers are doubted there as much as anywhere, and more further from P0.
        further = max(candidates.theta[c] / max((marks.known * marks.theta).max(), 1.0), 1.0)
        marks.known[number], marks.found[number] = True, candidates.last[c]
        marks.theta[number] = candidates.theta[c]
        marks.height[number] = candidates.height[c]
        # One that was covered in part is whole later on.
        marks.area[number] = max(candidates.area[c], WHOLE_AREA[0])
        marks.recent[number] = candidates.theta[c]
        marks.reference[number] = candidates.theta[c]
        marks.weight[number] = marks.weight_height[number] = 1.0
        marks.bias_height[number] = BIAS**2
        marks.var_theta[number] = 0.0
        marks.var_height[number] = 0.0
        marks.doubt_theta[number] = marks.doubt_theta.max() * further * further
        marks.doubt_height[number] = marks.doubt_height.max() * further * further
        candidates.hits[c] = 0
    return shift


@called
def acquire_markers(scan: Scan, shift: float) -> float:  # pragma: no cover
    """Look where unknown markers may be; those that move with the cylinder become known.

    Return the shift of a `Run` [rad], measured from P0 where that has become known.
    """
    marks, usable = scan.cable.marks, scan.setup.usable_azimuth
    starts, ends = _wanted_ranges(scan)
    for i in range(starts.size):
        # The visible part of every turn between the two wound angles.
        for lap in range(1 + math.floor((scan.turned + usable - starts[i]) / (math.tau))):
            facing = scan.turned - lap * math.tau
            low, high = max(starts[i], facing - usable), min(ends[i], facing + usable)
            if high > low:
                # Strips as wide as a search, side by side.
                width = scan.setup.search_width
                lanes = math.ceil(0.5 * (search_reach(scan.setup, marks, high) / width - 1.0))
                for lane in range(-lanes, lanes + 1):
                    _scan_turn(scan, low, high, 2.0 * lane * width)
    return confirm_candidates(scan.setup, marks, scan.candidates, scan.picture.colour_of, shift)


@called
def _wanted_ranges(scan: Scan) -> tuple[FloatArray, FloatArray]:  # pragma: no cover
    """Return the wound angles [rad] between which unknown markers may lie, first and last."""
    marks = scan.cable.marks
    markers = marks.known.size
    starts, ends = np.empty(markers), np.empty(markers)
    if not marks.known[0]:
        starts[0], ends[0] = -BAND_REACH, BAND_REACH
        return starts[:1], ends[:1]
    count, last = 0, 0
    for n in range(1, markers):
        if marks.known[n]:
            if n - last > 1:
                gap = (marks.theta[n] - marks.theta[last]) / (n - last)
                starts[count] = marks.theta[last] + LEAST_GAP * gap
                ends[count] = marks.theta[n] - LEAST_GAP * gap
                count += 1
            last = n
    if last < markers - 1:
        # A spacing that is set too large expects the next one farther on.
        least = 1.0 - LEAST_GAP
        starts[count] = marks.theta[last] + least * mean_gap(scan.setup, marks, last)
        ends[count] = scan.turned + APPROACH
        count += 1
    return starts[:count], ends[:count]


@called
def _scan_turn(scan: Scan, first: float, last: float, beside: float) -> None:  # pragma: no cover
    """Count marker pixels along a stretch, `beside` the cable [m], and verify where they gather."""
    setup, body = scan.setup, scan.setup.body
    scale = axis_scale(setup.camera)
    # Gates end so far beside a band: half of it shows as much to a search.
    stride = max(int(0.5 * scale * setup.across_margin), 1)
    step = stride / (scale * body.rho)
    nodes = int((last - first) / step) + 1
    counts = np.zeros(nodes)
    offsets = np.zeros(nodes)
    for k in range(nodes):
        counts[k], offsets[k] = _count_across(scan, first + k * step, beside, scale, stride)
    width = max(int(2.0 * body.half_band / (body.rho * step)), 1)
    # Half of the smallest band.
    least = NEW_AREA[0] * 2.0 * body.half_band * body.cable_radius * scale * scale
    least /= stride * stride
    for _ in range(CANDIDATES):
        place, most = _densest_window(counts, width)
        if most < least:
            return
        end = min(place + width, nodes)
        theta = first + 0.5 * (place + end) * step
        shift = beside + offsets[place:end].sum() / most / scale
        counts[place:end] = 0.0
        offsets[place:end] = 0.0
        verify_candidate(scan, theta, shift)


@called
def _count_across(
    scan: Scan, theta: float, beside: float, scale: float, stride: int
) -> tuple[float, float]:  # pragma: no cover
    """Count marker pixels of no known marker in the row across the cable at a wound angle.

    Return their number, and the sum of their distances from the row's middle [px], which lies
    `beside` the cable along z.
    """
    setup, body, pixels = scan.setup, scan.setup.body, scan.picture.pixels
    rows, columns = pixels.shape[:2]
    height, slope = corrected_height(scan.cable, theta)
    rho = body.rho + lift_at(scan.cable, theta)
    x, y, z = surface_point(
        rho, body.cable_radius, scan.turned - theta, height + beside, slope, 0.0
    )
    a, b, _depth = plane_of_point(setup.camera, x, y, z)
    column, row = pixel_of_plane(setup.camera, a, b)
    v = int(round(row))  # noqa: RUF046
    count, offset = 0.0, 0.0
    table = seeking(scan.picture, ANY).table
    if not 0 <= v < rows:
        return count, offset
    reach = setup.search_width * scale
    left = max(math.ceil(column - reach), 0)
    right = min(math.floor(column + reach), columns - 1)
    for u in range(left, right + 1, stride):
        index = table_index(pixels[v, u, 0], pixels[v, u, 1], pixels[v, u, 2])
        if table[index] and not _claimed(scan, float(u), float(v)):
            count += 1.0
            offset += u - column
    return count, offset


@called
def _claimed(scan: Scan, u: float, v: float) -> bool:  # pragma: no cover
    """Return whether a pixel lies in the gate of a known marker."""
    for n in range(scan.expected.outcome.size):
        if scan.expected.outcome[n] > COVERED and in_gate(scan.gates, n, u, v):
            return True
    return False


@called
def _densest_window(counts: FloatArray, width: int) -> tuple[int, float]:  # pragma: no cover
    """Return where the stretch of a given width that holds most begins, and what it holds."""
    total, best, place = counts[:width].sum(), 0.0, 0
    for k in range(counts.size):
        if total > best:
            best, place = total, k
        total -= counts[k]
        if k + width < counts.size:
            total += counts[k + width]
    return place, best
