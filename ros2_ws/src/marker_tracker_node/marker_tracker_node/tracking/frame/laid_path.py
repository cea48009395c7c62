"""Where the laid cable should be: the fleet-angle law, drawn through the known markers.

A guide may dwell and go back, so the path is laid by its readings until the markers lie elsewhere,
and by the commanded feed where no guide moves so far.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from marker_tracker_node.arrays import FloatArray
from marker_tracker_node.detection.band import Band
from marker_tracker_node.tracking.state import (
    BY_READINGS,
    CONTRADICTED,
    IMPOSSIBLE,
    KEPT,
    PATH_STEP,
    TRIED,
    Guide,
    Marks,
    Run,
    Setup,
    Tracks,
)
from winding_core.compiling import called
from winding_core.units import MILLIMETRE

# Before the contact line the free span stands off the cylinder: farther than the first [rad] it
# hangs before the turn beside it, nearer to the line it lies beside that; a marker on it proves
# itself from the second on.
SPAN_LAST, APPROACH = -0.3, 0.25
# Cable may lie beside a band whose middle is so far before P0, or before the landing [rad]: a tail
# is clamped half a radian behind P0, and a thick cable's band is as long.
TAIL = 1.0
# A band shows this far beside the place where it may be, or where bands are in sight [rad].
BAND_REACH = 0.4
# Places of a path in a turn.
TURN_PLACES = math.tau / PATH_STEP
# The next marker is no nearer than this share of the mean gap.
LEAST_GAP = 0.6
# How far the guide may stand before the contact line when P0 lands, one deviation [m], and how far
# a cable lies beside the path.
OFFSET_SIGMA, LAY_SIGMA = 4.5e-3, 1.0e-3
# Doubt of gaps by tape measure and stretch, relative: where the cylinder takes up 0.7 of the pull,
# markers of the study's softest cables lie a tenth nearer than its modulus gives.
GAP_SIGMA = 0.08
# Nothing that is right lies so many deviations off: in 135 runs markers were up to 4 mm beside the
# path of their guide, as it is fitted, where two had changed places 9 and 12 mm; in 101 films right
# numbers up to 4.9, and 5.4 along one axis of the data (once 6.3, where places hardly depend).
FARTHEST = 5.5
# Something proves itself by so many sightings, looks or passes, and by moving with the cylinder so
# far [rad], by which a gate finds a band, too.
PROOF_HITS, PROOF_ADVANCE = 3, 0.1
# A band stays at its place of the cylinder within this [rad], as poorly as the camera's pose is
# known: what stands still leaves its own mean by as much before it has moved by twice the above.
SAME_ANGLE = 0.08
# Looks for P0 are so far apart [rad]: with a fourth of its way a part of a cylinder of brass was
# taken for it.
LOOK_STEP = 0.1 * PROOF_ADVANCE
# Bands that lie so near to each other are the same band [m].
SAME_HEIGHT = 1.5 * LAY_SIGMA
# Led nearer than so many diameters a turn lies on the one before it, or else beside it.
ON_TOP = 0.75

# A guide that moves so many times as far as the feed, or as one turn beside the other, while a
# marker proves itself is nearer to one whose readings are millimetres.
MOST_SCALE = MILLIMETRE**-0.5
# A number may be set, or a guide move, so many times too far or too little: what is beyond has
# another cause.
USUAL_SCALE = 1.4


class LaidCable(NamedTuple):
    """The cable on the cylinder as far as it is known."""

    marks: Marks  # The markers
    path: FloatArray  # Its z, one of `Tracks.paths` [m]
    lift: FloatArray  # How high it lies on other turns, see there [m]; empty where nowhere
    covered: FloatArray  # Where others lie on it, see there; likewise
    filled: int  # Places of it that are filled


@called
def laid_cable(tracks: Tracks, run: Run) -> LaidCable:  # pragma: no cover
    """Return the cable along the path that is in use."""
    row = 0 if run.guide.laid_by == BY_READINGS else 1
    # The commanded feed leads one layer.
    layered = run.path_filled if row == 0 else 0
    lift, covered = tracks.paths[2, :layered], tracks.paths[3, :layered]
    return LaidCable(tracks.marks, tracks.paths[row], lift, covered, run.path_filled)


@called
def extend_paths(
    setup: Setup, paths: FloatArray, run: Run, start: float, way: float
) -> None:  # pragma: no cover
    """Lay the expected paths up to a frame: dz/dtheta = (z_guide - z) / lag.

    In the last frame the cylinder stood at `start` [rad], and the guide's way was `way` [m].
    """
    angle, guide, count = run.cylinder.angle, run.guide, run.path_filled
    share = 1.0 - math.exp(-PATH_STEP / setup.lag)
    while count < KEPT and count * PATH_STEP <= angle:
        middle = (count - 0.5) * PATH_STEP
        part = (middle - start) / (angle - start) if angle > start else 1.0
        place = way + (guide.way - way) * min(max(part, 0.0), 1.0)
        read = place + guide.offset
        paths[0, count] = paths[0, count - 1] + share * (read - paths[0, count - 1])
        commanded = setup.advance_per_radian * middle
        paths[1, count] = paths[1, count - 1] + share * (commanded - paths[1, count - 1])
        paths[2, count] = _lift(setup, paths, count)
        count += 1
    run.path_filled = count


@called
def _lift(setup: Setup, paths: FloatArray, last: int) -> float:  # pragma: no cover
    """Return how high the cable at the last place of the paths lies on others [m]; cover those."""
    path, lift = paths[0], paths[2]
    diameter, highest = 2.0 * setup.body.cable_radius, 0.0
    for turn in range(1, int(last / TURN_PLACES) + 1):
        place = last - turn * TURN_PLACES
        low = int(place)
        beside = path[last] - path[low] - (place - low) * (path[low + 1] - path[low])
        if _lies_on(setup, beside, turn, last * PATH_STEP):
            rise = math.sqrt(diameter * diameter - beside * beside)
            highest = max(highest, lift[low] + rise)
            paths[3, low] = paths[3, low + 1] = 1.0
    return highest


@called
def _lies_on(setup: Setup, beside: float, turns: int, theta: float) -> bool:  # pragma: no cover
    """Return whether cable lies on that so many turns before, led so far beside it [m].

    The next turn may be held off by the one before, and the second one has room beside the first;
    after that they are of other layers. The upper cable is at a wound angle [rad].
    """
    if turns == 1 and theta < 2.0 * math.tau:
        return False
    reach = ON_TOP if turns == 1 else 1.0
    return bool(abs(beside) < reach * 2.0 * setup.body.cable_radius)


@called
def lift_at(cable: LaidCable, theta: float) -> float:  # pragma: no cover
    """Return how high cable at a wound angle lies on other turns, as far as is expected [m]."""
    if cable.lift.size == 0 or theta <= 0.0:
        return 0.0
    return float(cable.lift[min(int(theta / PATH_STEP), cable.lift.size - 1)])


@called
def path_height(cable: LaidCable, theta: float) -> tuple[float, float]:  # pragma: no cover
    """Return expected z [m] and dz/dtheta [m/rad] at a wound angle."""
    last = cable.filled - 1
    place = theta / PATH_STEP
    if place <= 0.0 or last < 1:
        return 0.0, 0.0
    low = min(int(place), last - 1)
    slope = (cable.path[low + 1] - cable.path[low]) / PATH_STEP
    return cable.path[low] + slope * (theta - low * PATH_STEP), slope


@called
def mean_gap(setup: Setup, marks: Marks, last: int) -> float:  # pragma: no cover
    """Return the wound angle between markers [rad]: measured so far, or else expected."""
    if last > 0:
        return float((marks.theta[last] - marks.theta[0]) / last)
    return setup.expected_gap


@called
def known_around(marks: Marks, theta: float) -> tuple[int, int]:  # pragma: no cover
    """Return the numbers of the known markers below and above a wound angle, -1 for none."""
    below, above = -1, -1
    # A field of records is an array that is made anew wherever it is named.
    known, wound = marks.known, marks.theta
    for n in range(known.size):
        if known[n]:
            if wound[n] <= theta:
                below = n
            elif above < 0:
                above = n
    return below, above


@called
def corrected_height(cable: LaidCable, theta: float) -> tuple[float, float]:  # pragma: no cover
    """Return expected z [m] and slope, drawn through the markers that are known already."""
    height, slope = path_height(cable, theta)
    marks = cable.marks
    below, above = known_around(marks, theta)
    if below < 0 and above < 0:
        # P0 is not known yet, but where it passes may be.
        return height + marks.height[0], slope
    if below < 0:
        below = above
    first = marks.height[below] - path_height(cable, marks.theta[below])[0]
    if above < 0 or above == below:
        return height + first, slope
    second = marks.height[above] - path_height(cable, marks.theta[above])[0]
    tilt = (second - first) / (marks.theta[above] - marks.theta[below])
    return height + first + tilt * (theta - marks.theta[below]), slope + tilt


@called
def band_beside_turns(
    setup: Setup, cable: LaidCable, azimuth: float, theta: float, z: float, slope: float
) -> Band:  # pragma: no cover
    """Return a band with the turns of cable that lie beside it; theta is its wound angle [rad]."""
    below, above = math.inf, math.inf
    lean = setup.body.rho / math.hypot(setup.body.rho, slope)
    diameter = 2.0 * setup.body.cable_radius
    turn, lift = math.tau, lift_at(cable, theta)
    if theta - turn > -TAIL:
        away = (z - corrected_height(cable, theta - turn)[0]) * lean
        if lift - lift_at(cable, theta - turn) > setup.body.cable_radius:
            # What lies below a band shows beside it alone.
            away = math.copysign(max(abs(away), diameter), away)
        below, above = _nearer(below, above, away)
    if azimuth > turn - TAIL:
        away = (corrected_height(cable, theta + turn)[0] - z) * lean
        if known_around(cable.marks, theta + turn)[1] < 0:
            # Beyond the last marker the path is only expected: no turn lies in the one before.
            away = math.copysign(max(abs(away), diameter), away)
        below, above = _nearer(below, above, -away)
    low = -math.asin(below / diameter) if below < diameter else -math.pi
    high = math.asin(above / diameter) if above < diameter else math.pi
    return Band(azimuth, z, slope, low, high, below, above, lift)


@called
def _nearer(below: float, above: float, away: float) -> tuple[float, float]:  # pragma: no cover
    """Return the distances of the turns beside a band, one more so far to its -z side [m]."""
    if away >= 0.0:
        return min(below, away), above
    return below, min(above, -away)


@called
def covered_by_span(
    setup: Setup, cable: LaidCable, band: Band, theta: float
) -> bool:  # pragma: no cover
    """Return whether the cable that is about to land hangs before a band at a wound angle [rad]."""
    before = band.azimuth - math.tau
    if not -setup.usable_azimuth <= before < SPAN_LAST:
        return False
    # The path goes on past the landing with the slope of the free span.
    landing = theta + math.tau + before
    way = landing + math.sin(-before)
    distance = abs(corrected_height(cable, way)[0] - band.z)
    return bool(distance < 2.0 * setup.body.cable_radius + LAY_SIGMA)


@called
def covered_at(cable: LaidCable, theta: float) -> bool:  # pragma: no cover
    """Return whether later turns lie on cable at a wound angle [rad], as far as is expected."""
    place = int(round(theta / PATH_STEP))  # noqa: RUF046
    return bool(0 <= place < cable.covered.size and cable.covered[place] > 0.5)


@called
def unknown_beside(setup: Setup, cable: LaidCable, theta: float) -> bool:  # pragma: no cover
    """Return whether a marker that is not known yet may lie a turn behind a wound angle [rad]."""
    marks = cable.marks
    last = known_around(marks, math.inf)[0]
    if last < 0 or last == marks.known.size - 1:
        return False
    least = marks.theta[last] + LEAST_GAP * mean_gap(setup, marks, last)
    return bool(theta + math.tau + BAND_REACH > least)


@called
def lay_share(setup: Setup, theta: float) -> float:  # pragma: no cover
    """Return the share of an offset of the guide that cable at a wound angle [rad] lies off."""
    return 1.0 - math.exp(-max(theta, 0.0) / setup.lag)


@called
def first_sought(marks: Marks) -> bool:  # pragma: no cover
    """Return whether P0 alone is known, so that no marker shows yet where the guide stands."""
    return bool(marks.known[0] and marks.known.sum() == 1)


@called
def search_reach(setup: Setup, marks: Marks, theta: float) -> float:  # pragma: no cover
    """Return how far from the path a marker at a wound angle [rad] may lie [m]."""
    offset = FARTHEST * OFFSET_SIGMA if first_sought(marks) else 0.0
    return setup.search_width + offset * lay_share(setup, theta)


@called
def beside_path(
    setup: Setup, guide: Guide, marks: Marks, paths: FloatArray, filled: int, row: int, n: int
) -> float:  # pragma: no cover
    """Return how much farther from P0 marker n lies than on a path without any offset [m]."""
    expected, _ = path_height(
        LaidCable(marks, paths[row], paths[2, :0], paths[3, :0], filled), marks.theta[n]
    )
    if row == 0:
        expected -= guide.offset * lay_share(setup, marks.theta[n])
    return float(marks.height[n] - marks.height[0] - expected)


@called
def _off_path(
    setup: Setup, guide: Guide, marks: Marks, paths: FloatArray, filled: int, row: int, n: int
) -> float:  # pragma: no cover
    """Return how far marker n lies off a path and what its first turn may hold it off [m].

    Cable that would lie in its own first turn is held off by up to a diameter, and comes back to
    the path over some turns.
    """
    first = path_height(LaidCable(marks, paths[row], paths[2, :0], paths[3, :0], filled), math.tau)[
        0
    ]
    if row == 0:
        first -= guide.offset * lay_share(setup, math.tau)
    held = math.copysign(max(2.0 * setup.body.cable_radius - abs(first), 0.0), first)
    off = beside_path(setup, guide, marks, paths, filled, row, n)
    return abs(off - min(max(off, min(held, 0.0)), max(held, 0.0)))


@called
def fit_offset(setup: Setup, run: Run, marks: Marks, paths: FloatArray) -> None:  # pragma: no cover
    """Fit the guide's offset to the known markers; shift the path of its readings by the change."""
    guide, filled = run.guide, run.path_filled
    if guide.laid_by != BY_READINGS or not marks.known[0]:
        return
    product, square = 0.0, (LAY_SIGMA / OFFSET_SIGMA) ** 2
    for n in range(1, marks.known.size):
        if marks.known[n]:
            share = lay_share(setup, marks.theta[n])
            product += share * beside_path(setup, guide, marks, paths, filled, 0, n)
            square += share * share
    offset = product / square
    for k in range(1, filled):
        paths[0, k] += (offset - guide.offset) * lay_share(setup, k * PATH_STEP)
    guide.offset = offset


@called
def judge_guide(
    setup: Setup, run: Run, marks: Marks, paths: FloatArray
) -> None:  # pragma: no cover
    """Decide at a frame by what the path is laid; paths as in `Tracks`."""
    guide, filled, angle = run.guide, run.path_filled, run.cylinder.angle
    turned = abs(guide.turned)
    if guide.laid_by >= CONTRADICTED or turned < PROOF_ADVANCE:
        return
    feed = setup.advance_per_radian
    most = max(abs(feed), setup.body.cable_radius / math.pi) * turned * MOST_SCALE
    if abs(guide.travel) > most:
        _lay_by(guide, IMPOSSIBLE, angle)
        return
    expected = feed * guide.turned
    # In a turn or more; beyond that the markers decide.
    usual = abs(expected) <= USUAL_SCALE * abs(guide.travel)
    usual = usual and abs(guide.travel) <= USUAL_SCALE * abs(expected)
    usual = usual and guide.travel * expected >= 0.0
    if turned < math.tau or usual or not marks.known[0]:
        return
    last = known_around(marks, math.inf)[0]
    if last > 0:
        by_readings = _off_path(setup, guide, marks, paths, filled, 0, last)
        by_feed = _off_path(setup, guide, marks, paths, filled, 1, last)
        if by_readings > by_feed + LAY_SIGMA:
            _lay_by(guide, CONTRADICTED, angle)
            return
        if by_feed > by_readings + LAY_SIGMA and guide.laid_by == TRIED:
            _lay_by(guide, BY_READINGS, angle)
            return
    due = overdue(setup, marks, last) + setup.usable_azimuth
    missing = last < marks.known.size - 1 and angle > due
    if missing and angle > guide.since + math.tau:
        _lay_by(guide, BY_READINGS if guide.laid_by == TRIED else TRIED, angle)


@called
def _lay_by(guide: Guide, source: int, angle: float) -> None:  # pragma: no cover
    """Lay the path by another source, decided at a cylinder angle [rad]."""
    guide.laid_by = source
    guide.since = angle


@called
def overdue(setup: Setup, marks: Marks, last: int) -> float:  # pragma: no cover
    """Return the wound angle [rad] where a marker would be the one after that behind the last."""
    return float(marks.theta[last] + (1.0 + LEAST_GAP) * mean_gap(setup, marks, last))
