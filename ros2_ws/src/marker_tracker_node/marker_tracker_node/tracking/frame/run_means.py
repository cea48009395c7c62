"""Run means of the known markers, and what a frame reports of each."""

from __future__ import annotations

import math

from marker_tracker_node.arrays import FlagArray, FloatArray, IndexArray
from marker_tracker_node.camera.pinhole import pixels_per_metre
from marker_tracker_node.detection.band import Body
from marker_tracker_node.detection.gate import CLIPPED, COVERED, HIDDEN
from marker_tracker_node.tracking.state import Marks, Output, Run, Setup
from winding_core.compiling import called, compiled
from winding_core.markers import MarkerFlag

OCCLUDED, CUT_OFF, TOUCHING, SLIPPED, NOT_WOUND, PREDICTED = (
    int(MarkerFlag[name])
    for name in ("OCCLUDED", "CLIPPED", "TOUCHING", "SLIPPED", "NOT_WOUND", "PREDICTED")
)

# Frames that a run mean remembers, and sightings of a run that are explained: without an end
# neither could follow a change, and more do not average out what all have wrong together.
MEMORY = 400
# So many give its first value, and its scatter.
REFERENCE_FRAMES = 20.0
# Frames that a gate's aim remembers, which follows slip, and the azimuth of P0, which does not.
RECENT_FRAMES, SHIFT_FRAMES = 10.0, 50.0
# A wound angle that leans on the encoder carries the camera's tilt and counts less.
ENCODER_TRUST = 0.2
# One standard deviation of a band's middle in one frame [px], and as much again where a turn, whose
# place is only expected, cuts it off; what of it differs between frames; and the mask's bias, which
# depends on light, colour and azimuth and is the same in the next frame.
SIGHTING, SCATTER = 0.1, 0.05
BIAS = math.sqrt(SIGHTING**2 - SCATTER**2)
# Of z, where a thick cable is bent sharply: in so many r^2 / (R + r), r and R + r the radii of the
# cable and of its bend.
BENT = 0.045
# Of z, where a band lies on other turns, beside which theirs show: in so many cable diameters, as
# in sixteen windings of layers.
RAISED = 0.03
# What a run, in which a band is seen under every azimuth, leaves of the mask's bias and of that.
OVER_RUN, BENT_OVER_RUN = 0.7, 0.5
# A corrected value is gone over to by so much of its deviation in each frame.
STEP = 0.5


@called
def update_shift(run: Run, azimuth: float, turned: float) -> None:  # pragma: no cover
    """Take the azimuth of P0 as seen [rad], nan where it is not, into the shift of a run.

    The cylinder's angle as the camera is expected to see it is `turned` [rad].
    """
    if run.cylinder.blind or not math.isfinite(azimuth):
        return
    run.shift_weight = min(run.shift_weight + 1.0, SHIFT_FRAMES)
    run.shift += (azimuth - turned) / run.shift_weight


@called
def whole_share(marks: Marks) -> float:  # pragma: no cover
    """Return measured over expected area of a band that is seen whole, as P0 is as it lands."""
    return float(marks.area[0]) if marks.known[0] else 1.0


@called
def _joint(one: float, other: float) -> float:  # pragma: no cover
    """Return by how much the deviation of a difference of two measurements is larger."""
    return 1.0 if one == other == 1.0 else math.sqrt(0.5 * (one * one + other * other))


@called
def update_means(marks: Marks, out: Output, k: int, turned: float) -> None:  # pragma: no cover
    """Take the bands measured in frame k into the run means; write their wound angles.

    The cylinder's angle as the camera sees it is `turned` [rad].
    """
    with_p0 = math.isfinite(out.azimuth[k, 0])
    base = out.azimuth[k, 0] if with_p0 else turned
    trust = 1.0 if with_p0 else ENCODER_TRUST
    first = out.sigma_theta[k, 0] if with_p0 else 1.0
    for n in range(marks.known.size):
        if not math.isfinite(out.azimuth[k, n]):
            continue
        theta = base - out.azimuth[k, n]
        out.theta[k, n] = theta
        d_theta = theta - marks.theta[n]
        # What is seen in part counts less.
        factor = _joint(out.sigma_theta[k, n], first)
        mine = trust / (factor * factor)
        own_theta = d_theta / factor
        marks.weight[n] = min(marks.weight[n] + mine, MEMORY)
        marks.theta[n] += mine / marks.weight[n] * d_theta
        marks.var_theta[n] += (own_theta * own_theta - marks.var_theta[n]) / REFERENCE_FRAMES
        part_z = out.sigma_height[k, n]
        if math.isfinite(part_z):
            d_height, square = out.seen_height[k, n] - marks.height[n], part_z * part_z
            own_height, mine = d_height / part_z, trust / square
            marks.weight_height[n] = min(marks.weight_height[n] + mine, MEMORY)
            mine /= marks.weight_height[n]
            marks.height[n] += mine * d_height
            marks.bias_height[n] += mine * (square * BIAS**2 - marks.bias_height[n])
            change = own_height * own_height - marks.var_height[n]
            marks.var_height[n] += change / REFERENCE_FRAMES
        marks.recent[n] += (theta - marks.recent[n]) / RECENT_FRAMES
        if marks.weight[n] <= REFERENCE_FRAMES:
            marks.reference[n] = marks.theta[n]


@called
def write_results(
    setup: Setup,
    marks: Marks,
    outcome: IndexArray,
    touching: FlagArray,
    turned: float,
    out: Output,
    k: int,
) -> None:  # pragma: no cover
    """Write wound angle and height from P0, their deviations and the flags of frame k.

    Outcomes and whether bands touch have shape (markers,); the cylinder's angle as the camera sees
    it is `turned` [rad].
    """
    p0_seen = math.isfinite(out.seen_height[k, 0])
    base = out.seen_height[k, 0] if p0_seen else marks.height[0]
    facing = pixel_size(setup, 0.0)
    mean_theta, mean_height = _mean_variances(setup, facing, marks, 0)
    first, from_theta, from_height = 1.0, mean_theta, mean_height
    if p0_seen:
        first = out.sigma_theta[k, 0]
        from_theta, from_height = _bias_variances(setup, out, k, 0)
        from_theta *= first * first
        part_z = out.sigma_height[k, 0]
        from_height = from_height * part_z * part_z if math.isfinite(part_z) else mean_height
    # A mark that is no ring moves around the section with the cable: P0's and its own both count.
    twisted = 2.0 * (setup.torsion * setup.body.cable_radius) ** 2
    for n in range(marks.known.size):
        if not marks.known[n] or (n > 0 and turned < marks.recent[n]):
            out.theta[k, n] = out.height[k, n] = math.nan
            out.sigma_theta[k, n] = out.sigma_height[k, n] = math.nan
            out.marker_flags[k, n] = NOT_WOUND
            continue
        flags = 0
        if math.isfinite(out.azimuth[k, n]):
            part, part_z = out.sigma_theta[k, n], out.sigma_height[k, n]
            out.height[k, n] = out.seen_height[k, n] - base
            own_theta, own_height = _bias_variances(setup, out, k, n)
            own_theta *= part * part
            own_theta += from_theta
            own_theta += _joint(part, first) ** 2 * _scatter(marks.var_theta[n], facing[0])
            own_height += _scatter(marks.var_height[n], facing[1])
            own_height *= part_z * part_z
            own_theta += marks.doubt_theta[n]
            own_height += marks.doubt_height[n] + _raised(setup, marks, n)
            if not math.isfinite(part_z):
                # Cut off on both sides it lies where it did.
                own_height = _mean_variances(setup, facing, marks, n)[1]
            own_height += from_height
        else:
            flags |= PREDICTED
            out.theta[k, n] = marks.theta[n]
            out.height[k, n] = marks.height[n] - marks.height[0]
            own_theta, own_height = _mean_variances(setup, facing, marks, n)
            own_theta += mean_theta
            own_height += mean_height
            if outcome[n] == CLIPPED:
                flags |= CUT_OFF
            out.covered[k, n] = outcome[n] == COVERED
            if outcome[n] == HIDDEN or out.covered[k, n]:
                flags |= OCCLUDED
        if marks.left_theta[n] != 0.0 or marks.left_height[n] != 0.0:
            own_theta += _follow(out.theta, marks.left_theta, k, n, own_theta)
            own_height += _follow(out.height, marks.left_height, k, n, own_height)
        out.sigma_theta[k, n] = math.sqrt(own_theta)
        out.sigma_height[k, n] = math.sqrt(own_height + twisted)
        if touching[n]:
            flags |= TOUCHING
        if abs(marks.recent[n] - marks.reference[n]) > setup.slip_limit:
            flags |= SLIPPED
        out.marker_flags[k, n] = flags


@called
def _follow(
    out: FloatArray, left: FloatArray, k: int, n: int, variance: float
) -> float:  # pragma: no cover
    """Let what is published of marker n go over to a corrected value of a variance.

    Return the variance of what is left of the way; `out` and `left`, see `Marks`, are written.
    """
    left[n] -= math.copysign(min(abs(left[n]), STEP * math.sqrt(variance)), left[n])
    out[k, n] += left[n]
    return float(left[n] * left[n])


@called
def _bias_variances(
    setup: Setup, out: Output, k: int, n: int
) -> tuple[float, float]:  # pragma: no cover
    """Return what azimuth [rad^2] and z [m^2] of a band measured in frame k may have in common."""
    angle, height = pixel_size(setup, out.azimuth[k, n])
    cut = out.low[k, n] > -math.pi or out.high[k, n] < math.pi
    # What scatter does not show; what a cut leaves of z is in the factor of its deviation.
    pixels = BIAS**2 + (SIGHTING**2 if cut else 0.0)
    return angle * angle * pixels, (height * BIAS) ** 2 + bent_height(setup.body) ** 2


@called
def _raised(setup: Setup, marks: Marks, n: int) -> float:  # pragma: no cover
    """Return the variance of z that comes of turns below a band [m^2]."""
    sigma = RAISED * 2.0 * setup.body.cable_radius
    return sigma * sigma if marks.lift[n] > 0.0 else 0.0


@called
def _scatter(seen: float, pixel: float) -> float:  # pragma: no cover
    """Return the variance between frames: as seen, and no less than pixels allow."""
    return max(seen, (SCATTER * pixel) ** 2)


@called
def _mean_variances(
    setup: Setup, facing: tuple[float, float], marks: Marks, n: int
) -> tuple[float, float]:  # pragma: no cover
    """Return the variances of a run mean, see `mean_variances`; facing is a pixel's size there."""
    weight, weight_height = max(marks.weight[n], 1.0), max(marks.weight_height[n], 1.0)
    return (
        (OVER_RUN * BIAS * facing[0]) ** 2
        + _scatter(marks.var_theta[n], facing[0]) / weight
        + marks.doubt_theta[n],
        marks.bias_height[n] * (OVER_RUN * facing[1]) ** 2
        + (BENT_OVER_RUN * bent_height(setup.body)) ** 2
        + _scatter(marks.var_height[n], facing[1]) / weight_height
        + _raised(setup, marks, n)
        + marks.doubt_height[n],
    )


@compiled
def mean_variances(setup: Setup, marks: Marks, n: int) -> tuple[float, float]:  # pragma: no cover
    """Return the variances of a run mean's azimuth [rad^2] and z [m^2], as seen by the camera."""
    return _mean_variances(setup, pixel_size(setup, 0.0), marks, n)


@called
def pixel_size(setup: Setup, azimuth: float) -> tuple[float, float]:  # pragma: no cover
    """Return the angle [rad] and the height [m] that a pixel covers at a band's azimuth."""
    rho = setup.body.rho
    facing = math.cos(azimuth)
    height = 1.0 / pixels_per_metre(setup.camera, abs(setup.camera.x) - rho * facing)
    return height / (rho * facing), height


@called
def bent_height(body: Body) -> float:  # pragma: no cover
    """Return one deviation of z that a thick cable's bend adds in one frame, at any scale [m]."""
    return BENT * body.cable_radius * body.cable_radius / body.rho
