"""One frame: from an image and an encoder reading to every marker's wound angle and height."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.detection.band import Band, moved_band
from marker_tracker_node.detection.gate import Gates, Picture, empty_gates
from marker_tracker_node.tracking.band_measurement import WHOLE_AREA, measure_band
from marker_tracker_node.tracking.candidates import Scan
from marker_tracker_node.tracking.cylinder_angle import follow_encoder, phase_lock
from marker_tracker_node.tracking.gate_prediction import (
    COVERED,
    HIDDEN,
    MEASURED,
    OUT_OF_SIGHT,
    TOUCH_REACH,
    Shutter,
    bands_touch,
    gate_visibility,
    gates_meet,
    guarded,
    predict_gate,
    separate_gates,
    shutter_of,
    turned_since,
)
from marker_tracker_node.tracking.guide_readings import fit_offset, follow_guide, judge_guide
from marker_tracker_node.tracking.laid_path import (
    LaidCable,
    band_beside_turns,
    corrected_height,
    covered_by_span,
    extend_paths,
    laid_cable,
    stranger_beside,
)
from marker_tracker_node.tracking.marker_acquisition import acquire_markers
from marker_tracker_node.tracking.run_means import update_means, update_shift, write_results
from marker_tracker_node.tracking.state import (
    Cylinder,
    FlagArray,
    IndexArray,
    Marks,
    Output,
    Run,
    Setup,
    Tracks,
)
from marker_tracker_node.tracking.tracker_state import (
    output_of,
    run_of,
    setup_of,
    tracks_of,
    write_run,
)
from winding_core.compiling import called, compiled

FloatArray = NDArray[np.float64]
ByteArray = NDArray[np.uint8]

AREA_SHARE = 0.05
JUMP_THETA = 0.12
JUMP_HEIGHT = 1.5e-3
REAIM = 0.4
# A band so far out of sight [rad] may still show beside one that is in sight.
NEAR_SIGHT = 0.4


class Expected(NamedTuple):
    """Where the known markers are expected in a frame, arrays of shape (markers,).

    Attributes:
        outcome: What came of looking for the marker.
        near: Whether its band is in sight, or so little beyond that it may touch one that is.
        pixels: That its band should fill.
        touching: Whether its band touches another.
        azimuth: See `Band`, and so are the following.
        slope: [m/rad]
        low: [rad]
        high: [rad]
        below: [m]
        above: [m]
    """

    outcome: IndexArray
    near: FlagArray
    pixels: FloatArray
    touching: FlagArray
    azimuth: FloatArray
    slope: FloatArray
    low: FloatArray
    high: FloatArray
    below: FloatArray
    above: FloatArray


@compiled
def update_burst(
    frames: ByteArray,
    table: ByteArray,
    fixed: FloatArray,
    numbers: FloatArray,
    known: FlagArray,
    marks: FloatArray,
    hits: IndexArray,
    candidates: FloatArray,
    paths: FloatArray,
    readings: FloatArray,
    angle: FloatArray,
    flags: NDArray[np.uint32],
    fields: FloatArray,
) -> None:  # pragma: no cover
    """Advance a tracker's state by every frame of a burst.

    Args:
        frames: Shape (k, rows, columns, 3).
        table: See `Picture`.
        fixed: See `setup_numbers`.
        numbers: See `TrackerState`, and so are the following; they are written in place.
        known: Likewise.
        marks: Likewise.
        hits: Likewise.
        candidates: Likewise.
        paths: Likewise.
        readings: Ascending times [s], cylinder angles [rad], nan where missing, guide positions
            [m], nan to expect the commanded feed, and how much further P0 is expected than encoder
            and shift say [rad], shape (4, k).
        angle: See `OutputRoom`, and so are the following; they receive what each frame yields.
        flags: Likewise.
        fields: Likewise.
    """
    setup, run = setup_of(fixed), run_of(numbers)
    tracks = tracks_of(known, marks, hits, candidates, paths)
    out = output_of(angle, flags, fields)
    for k in range(frames.shape[0]):
        picture = Picture(frames[k], table)
        cylinder = follow_encoder(run.cylinder, readings[0, k], readings[1, k])
        guide = follow_guide(setup, run.guide, run.cylinder, cylinder, readings[2, k])
        filled = extend_paths(setup, paths, run, cylinder.angle, guide)
        guide = judge_guide(setup, guide, tracks.marks, paths, filled, cylinder.angle)
        run = Run(cylinder, guide, run.shift, run.shift_weight, filled)
        run = _update_frame(picture, setup, run, readings[3, k], tracks, out, k)
        angle[k] = run.cylinder.angle
    write_run(run, numbers)


@called
def _update_frame(
    picture: Picture,
    setup: Setup,
    run: Run,
    lead: float,
    tracks: Tracks,
    out: Output,
    k: int,
) -> Run:  # pragma: no cover
    """Measure the known markers of frame k, look for the others, and return the run after it.

    Args:
        picture: Frame and colours.
        setup: Machine and camera.
        run: At the frame, as far as it is known without looking.
        lead: How much further P0 is expected [rad].
        tracks: Written in place.
        out: Receives what the frame yields.
        k: Number of the frame.
    """
    marks, cylinder, guide = tracks.marks, run.cylinder, run.guide
    cable = laid_cable(tracks, run)
    count = marks.known.size
    turned = cylinder.angle + run.shift
    gates = empty_gates(count + 1)
    expected = _empty_expected(count)
    shutter = shutter_of(setup, cylinder.rate, picture.pixels.shape[0])
    _predict(picture, setup, shutter, cable, turned, lead, gates, expected)
    for n in range(count):
        # Neither out of sight nor clipped.
        if expected.outcome[n] == HIDDEN:
            expected.outcome[n] = _measure(
                picture, setup, shutter, marks, gates, n, expected, out, k
            )
    if cylinder.blind:
        nudge = phase_lock(marks, out.azimuth[k], turned)
        turned += nudge
        cylinder = Cylinder(
            cylinder.angle + nudge, cylinder.time, cylinder.rate, cylinder.wraps,
            cylinder.started, cylinder.blind, cylinder.read,
        )  # fmt: skip
    shift, weight = update_shift(run, cylinder.blind, out.azimuth[k, 0], turned)
    update_means(marks, out, k, turned)
    found = marks.known.sum()
    if found < count:
        scan = Scan(
            picture,
            setup,
            cable,
            tracks.candidates,
            gates,
            expected.outcome,
            cylinder.angle + shift,
            shutter,
        )
        shift = acquire_markers(scan, shift)
        if marks.known.sum() > found:
            guide = fit_offset(setup, guide, marks, tracks.paths, run.path_filled)
    write_results(setup, marks, expected.outcome, expected.touching, turned, out, k)
    return Run(cylinder, guide, shift, weight, run.path_filled)


@called
def _empty_expected(count: int) -> Expected:  # pragma: no cover
    """Return room for what is expected of a number of markers, all of them out of sight."""
    return Expected(
        outcome=np.full(count, OUT_OF_SIGHT),
        near=np.zeros(count, dtype=np.bool_),
        pixels=np.zeros(count),
        touching=np.zeros(count, dtype=np.bool_),
        azimuth=np.zeros(count),
        slope=np.zeros(count),
        low=np.zeros(count),
        high=np.zeros(count),
        below=np.zeros(count),
        above=np.zeros(count),
    )


@called
def _predict(
    picture: Picture,
    setup: Setup,
    shutter: Shutter,
    cable: LaidCable,
    turned: float,
    lead: float,
    gates: Gates,
    expected: Expected,
) -> None:  # pragma: no cover
    """Write where the known markers are expected, and the gates of those in sight."""
    marks = cable.marks
    count = marks.known.size
    for n in range(count):
        if not marks.known[n]:
            continue
        theta, z = marks.recent[n], marks.height[n]
        azimuth = turned - theta
        if n == 0:
            azimuth += lead
        elif azimuth < 0.0:
            continue
        away = azimuth - 2.0 * math.pi * round(azimuth / (2.0 * math.pi))
        beyond = abs(away) > setup.usable_azimuth
        if beyond and (
            abs(away) > setup.usable_azimuth + NEAR_SIGHT or not _beside(setup, marks, n)
        ):
            continue
        slope = corrected_height(cable, theta)[1]
        azimuth += turned_since(setup, shutter, azimuth, z)
        band = band_beside_turns(setup, cable, azimuth, theta, z, slope)
        band = guarded(setup, band, False, stranger_beside(setup, cable, theta))
        expected.near[n] = True
        expected.pixels[n] = predict_gate(setup, band, gates, n)
        if not beyond:
            expected.outcome[n] = gate_visibility(setup, gates, n, picture)
            if covered_by_span(setup, cable, band, theta):
                expected.outcome[n] = COVERED
        expected.azimuth[n], expected.slope[n] = azimuth, slope
        expected.low[n], expected.high[n] = band.low, band.high
        expected.below[n], expected.above[n] = band.below, band.above
    for n in range(count):
        for m in range(n + 1, count):
            near = expected.near[n] and expected.near[m]
            if not (near and gates_meet(gates, n, m, TOUCH_REACH)):
                continue
            if bands_touch(gates, n, m):
                expected.touching[n] = expected.touching[m] = True
            ahead = marks.height[m] >= marks.height[n]
            _guard(setup, marks, n, not ahead, ahead, gates, expected)
            _guard(setup, marks, m, ahead, not ahead, gates, expected)
            separate_gates(gates, n, m)


@called
def _beside(setup: Setup, marks: Marks, n: int) -> bool:  # pragma: no cover
    """Return whether another known marker lies so near along the cylinder that bands may meet."""
    reach = 2.0 * (setup.body.cable_radius + setup.across_margin)
    for m in range(marks.known.size):
        if m != n and marks.known[m] and abs(marks.height[m] - marks.height[n]) < reach:
            return True
    return False


@called
def _guard(
    setup: Setup,
    marks: Marks,
    n: int,
    below: bool,
    above: bool,
    gates: Gates,
    expected: Expected,
) -> None:  # pragma: no cover
    """Cut the band n and its gate off before the turn below or above; see `guarded`."""
    band = Band(
        expected.azimuth[n], marks.height[n], expected.slope[n],
        expected.low[n], expected.high[n], expected.below[n], expected.above[n],
    )  # fmt: skip
    band = guarded(setup, band, below, above)
    if band.low == expected.low[n] and band.high == expected.high[n]:
        return
    ahead, behind = gates.ahead[n], gates.behind[n]
    expected.pixels[n] = predict_gate(setup, band, gates, n)
    gates.ahead[n] = min(gates.ahead[n], ahead)
    gates.behind[n] = min(gates.behind[n], behind)
    expected.low[n], expected.high[n] = band.low, band.high


@compiled
def _measure(
    picture: Picture,
    setup: Setup,
    shutter: Shutter,
    marks: Marks,
    gates: Gates,
    n: int,
    expected: Expected,
    out: Output,
    k: int,
) -> int:  # pragma: no cover
    """Measure the known marker n in frame k and return what came of it."""
    band = Band(
        expected.azimuth[n], marks.height[n], expected.slope[n],
        expected.low[n], expected.high[n], expected.below[n], expected.above[n],
    )  # fmt: skip
    pixels, place = expected.pixels[n], band
    azimuth, z, share = math.nan, math.nan, 0.0
    for attempt in range(2):
        outcome, azimuth, z, share = measure_band(
            picture, setup, gates, n, place, pixels * marks.area[n], WHOLE_AREA
        )
        if outcome != MEASURED:
            return outcome
        off = abs(azimuth - band.azimuth) * setup.body.rho
        if attempt == 1 or off <= REAIM * setup.along_margin:
            break
        # Far from where it was expected the gate may have cut the band: look again.
        place = moved_band(band, azimuth, z)
        ahead, behind = gates.ahead[n], gates.behind[n]
        pixels = predict_gate(setup, place, gates, n)
        gates.ahead[n] = min(gates.ahead[n], ahead)
        gates.behind[n] = min(gates.behind[n], behind)
    if abs(azimuth - band.azimuth) > JUMP_THETA or abs(z - band.z) > JUMP_HEIGHT:
        return HIDDEN
    marks.area[n] *= 1.0 + AREA_SHARE * (share - 1.0)
    out.azimuth[k, n] = azimuth - turned_since(setup, shutter, azimuth, z)
    out.seen_height[k, n], out.slope[k, n] = z, band.slope
    out.low[k, n], out.high[k, n] = band.low, band.high
    return MEASURED
