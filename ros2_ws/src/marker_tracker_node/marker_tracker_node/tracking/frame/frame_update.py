"""One frame: from an image and an encoder reading to every marker's wound angle and height."""

from __future__ import annotations

import math

from marker_tracker_node.arrays import ByteArray, FloatArray, IndexArray
from marker_tracker_node.detection.band import band_of, moved_band
from marker_tracker_node.detection.colour_band import WHOLE_AREA
from marker_tracker_node.detection.detectors import measure_mark
from marker_tracker_node.detection.gate import (
    CLIPPED,
    COVERED,
    FIRST_COLOUR,
    HIDDEN,
    NO_IDENTITY,
    NOTHING,
    TABLE_SIZE,
    Gates,
    Picture,
    empty_gates,
    gate_visibility,
    seeking,
    several_colours,
)
from marker_tracker_node.tracking.frame.acquisition import acquire_markers
from marker_tracker_node.tracking.frame.expected_bands import (
    Expected,
    Scan,
    empty_expected,
    expect_band,
    expect_bands,
)
from marker_tracker_node.tracking.frame.gate_prediction import (
    gate_margin,
    predict_gate,
    separate_gates,
    shutter_of,
    turned_since,
)
from marker_tracker_node.tracking.frame.laid_path import (
    PROOF_ADVANCE,
    PROOF_HITS,
    SAME_HEIGHT,
    fit_offset,
    judge_guide,
    laid_cable,
)
from marker_tracker_node.tracking.frame.run_means import (
    REFERENCE_FRAMES,
    update_means,
    update_shift,
    whole_share,
    write_results,
)
from marker_tracker_node.tracking.machine_motion import advance_machine, phase_lock
from marker_tracker_node.tracking.state import (
    FixedNumbers,
    Output,
    Rows,
    Run,
    Setup,
    Tracks,
    setup_of,
)
from winding_core.compiling import called, compiled

# A gate that is off by more of its room along the cable may cut the band.
REAIM = 0.4


@compiled
def update_burst(
    frames: ByteArray,
    tables: ByteArray,
    colour_of: IndexArray,
    fixed: FixedNumbers,
    run_rows: Rows,
    marks: Rows,
    candidates: Rows,
    paths: FloatArray,
    readings: FloatArray,
    angle: FloatArray,
    out: Rows,
) -> None:  # pragma: no cover
    """Advance a tracker's state by every frame of a burst.

    Args:
        frames: Shape (k, rows, columns, 3).
        tables: See `Palette`, shape ((2 + colours) 32768,).
        colour_of: See `Palette`, shape (markers,).
        fixed: See `fixed_numbers`.
        run_rows: Of RUN, shape (1,), written in place as are the following.
        marks: Of MARK, shape (markers,).
        candidates: Of CANDIDATE, shape (CANDIDATES,).
        paths: See `Tracks`, shape (4, KEPT).
        readings: Ascending times [s], cylinder angles [rad], nan where missing, guide positions
            [m], nan to expect the commanded feed, how much further P0 is expected than encoder and
            shift place it [rad], and how far beside that it is sought if it is not there [rad],
            shape (5, k).
        angle: Receives that of each frame [rad], shape (k,).
        out: Receives what each frame yields, rows of SEEN, shape (k, markers).
    """
    setup, run, tracks = setup_of(fixed), run_rows[0], Tracks(marks, candidates, paths)
    count = marks.size
    gates, expected = empty_gates(count + 1), empty_expected(count)
    first = tables[FIRST_COLOUR * TABLE_SIZE : (FIRST_COLOUR + 1) * TABLE_SIZE]
    for k in range(frames.shape[0]):
        picture = Picture(frames[k], first, tables, colour_of)
        advance_machine(setup, run, paths, readings[0, k], readings[1, k], readings[2, k])
        judge_guide(setup, run, tracks.marks, paths)
        _update_frame(picture, setup, run, readings[3:, k], tracks, gates, expected, out, k)
        angle[k] = run.cylinder.angle


@called
def _update_frame(
    picture: Picture,
    setup: Setup,
    run: Run,
    place: FloatArray,
    tracks: Tracks,
    gates: Gates,
    expected: Expected,
    out: Output,
    k: int,
) -> None:  # pragma: no cover
    """Measure the known markers of frame k and look for the others.

    The run is known at the frame as far as it is without looking, `place` is that of P0 in the
    last rows of `readings`; gates are those of the markers and one more.
    """
    marks, cylinder = tracks.marks, run.cylinder
    cable = laid_cable(tracks, run)
    count = marks.known.size
    turned = cylinder.angle + run.shift
    shutter = shutter_of(setup, cylinder.rate, picture.pixels.shape[0])
    scan = Scan(picture, setup, shutter, cable, tracks.candidates, gates, expected, turned)
    expect_bands(scan, place[0])
    for n in range(count):
        # Neither out of sight nor covered nor clipped.
        if expected.outcome[n] == HIDDEN:
            expected.outcome[n] = _measure(scan, n, out, k)
    if marks.known[0] and not math.isfinite(out.azimuth[k, 0]):
        first, step = turned - marks.recent[0] + place[0], 1
        while abs(step) * PROOF_ADVANCE <= place[1]:
            azimuth = first + step * PROOF_ADVANCE
            expect_band(scan, 0, azimuth)
            if _seen_beside(scan, out, k):
                break
            step = -step if step > 0 else 1 - step
    if cylinder.blind:
        nudge = phase_lock(marks, out.azimuth[k], turned)
        turned += nudge
        cylinder.angle += nudge
    update_shift(run, out.azimuth[k, 0], turned)
    update_means(marks, out, k, turned)
    found = marks.known.sum()
    if found < count:
        lost = not marks.known[0]
        seen = cylinder.angle + run.shift
        scan = Scan(picture, setup, shutter, cable, tracks.candidates, gates, expected, seen)
        run.shift = acquire_markers(scan, run.shift)
        if lost and marks.known[0]:
            # A turn from here on shows the other markers.
            run.guide.since = cylinder.angle
        if marks.known.sum() > found:
            fit_offset(setup, run, marks, tracks.paths)
    write_results(setup, marks, expected.outcome, expected.touching, turned, out, k)


@called
def _seen_beside(scan: Scan, out: Output, k: int) -> bool:  # pragma: no cover
    """Return whether P0 is seen where it is expected now, at its height and apart from others."""
    expected, marks = scan.expected, scan.cable.marks
    if expected.outcome[0] != HIDDEN:
        return False
    for n in range(1, marks.known.size):
        if expected.outcome[n] > COVERED:
            separate_gates(scan.gates, n, 0)
    found = _measure(scan, 0, out, k)
    # It is nan where nothing was measured.
    beside = abs(out.seen_height[k, 0] - marks.height[0])
    if not beside <= 0.5 * scan.setup.body.cable_radius:
        out.azimuth[k, 0] = out.seen_height[k, 0] = math.nan
        return False
    expected.outcome[0] = found
    return True


@compiled
def _measure(scan: Scan, n: int, out: Output, k: int) -> int:  # pragma: no cover
    """Measure the known marker n in frame k and return what came of it."""
    picture, setup, gates, marks = scan.picture, scan.setup, scan.gates, scan.cable.marks
    area = marks.area
    band = band_of(scan.expected.bands[n])
    pixels, place = scan.expected.pixels[n], band
    if several_colours(picture):
        picture = seeking(picture, picture.colour_of[n])
    azimuth, z, found = math.nan, math.nan, NOTHING
    # Each look shows more of a band that was cut; one that is still elsewhere then is none.
    for _ in range(PROOF_HITS):
        found = measure_mark(
            setup.detector, picture, setup.camera, setup.body, gates, n, place, pixels, area[n],
            whole_share(marks), WHOLE_AREA,
        )  # fmt: skip
        if found.outcome == HIDDEN or found.identity not in (NO_IDENTITY, n):
            return HIDDEN
        azimuth, z = found.azimuth, found.z
        if abs(azimuth - place.azimuth) * setup.body.rho <= REAIM * setup.along_margin:
            break
        # Far from where it was expected the gate, or the picture, may have cut the band.
        place = moved_band(band, azimuth, z)
        ahead, behind = gates.ahead[n], gates.behind[n]
        pixels = predict_gate(setup, place, gates, n)
        if gate_visibility(gates, n, gate_margin(setup), picture) != HIDDEN:
            return CLIPPED
        gates.ahead[n] = min(gates.ahead[n], ahead)
        gates.behind[n] = min(gates.behind[n], behind)
    else:
        return HIDDEN
    if abs(azimuth - band.azimuth) > PROOF_ADVANCE or abs(z - band.z) > SAME_HEIGHT:
        return HIDDEN
    if band.low == -math.pi and band.high == math.pi:
        # Of one that is cut off it shows where that lies beside its gate.
        area[n] *= 1.0 + (found.share - 1.0) / REFERENCE_FRAMES
    out.azimuth[k, n] = azimuth - turned_since(setup, scan.shutter, azimuth, z)
    out.seen_height[k, n], out.slope[k, n] = z, band.slope
    out.low[k, n], out.high[k, n] = band.low, band.high
    marks.lift[n] = band.lift
    out.below[k, n], out.above[k, n], out.lift[k, n] = band.below, band.above, band.lift
    out.sigma_theta[k, n], out.sigma_height[k, n] = found.azimuth_factor, found.z_factor
    return found.outcome
