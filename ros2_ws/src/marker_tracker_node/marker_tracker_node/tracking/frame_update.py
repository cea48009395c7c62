"""One frame: from an image and an encoder reading to every marker's wound angle and height."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.detection.band import Band, moved_band
from marker_tracker_node.detection.gate import (
    FIRST_COLOUR,
    TABLE_SIZE,
    Gates,
    Picture,
    empty_gates,
    seeking,
    several_colours,
)
from marker_tracker_node.detection.palette import Palette
from marker_tracker_node.tracking.band_measurement import NOTHING, WHOLE_AREA, measure_band
from marker_tracker_node.tracking.candidates import Scan
from marker_tracker_node.tracking.cylinder_angle import follow_encoder, phase_lock
from marker_tracker_node.tracking.gate_prediction import (
    HIDDEN,
    OUT_OF_SIGHT,
    PARTLY,
    Shutter,
    gate_visibility,
    predict_gate,
    separate_gates,
    shutter_of,
    turned_since,
)
from marker_tracker_node.tracking.laid_path import (
    LaidCable,
    band_beside_turns,
    corrected_height,
    extend_path,
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
from winding_core.compiling import called, compiled

FloatArray = NDArray[np.float64]
ByteArray = NDArray[np.uint8]

AREA_SHARE = 0.05
JUMP_THETA = 0.12
JUMP_HEIGHT = 1.5e-3
REAIM = 0.4


class Expected(NamedTuple):
    """Where the known markers are expected in a frame, arrays of shape (markers,).

    Attributes:
        outcome: What came of looking for the marker.
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
    palette: Palette,
    setup: Setup,
    run: Run,
    tracks: Tracks,
    times: FloatArray,
    encoders: FloatArray,
    guides: FloatArray,
    leads: FloatArray,
    out: Output,
) -> Run:  # pragma: no cover
    """Advance the tracks by every frame of a burst and return the run after it.

    Args:
        frames: Shape (k, rows, columns, 3).
        palette: Colours of the markers.
        setup: Machine and camera.
        run: Before the first frame.
        tracks: Written in place.
        times: Ascending [s], shape (k,).
        encoders: Cylinder angles [rad], nan where missing, shape (k,).
        guides: Guide positions [m], nan to expect the commanded feed, shape (k,).
        leads: How much further P0 is expected than encoder and shift say [rad], shape (k,).
        out: Receives what each frame yields.
    """
    first = palette.tables[FIRST_COLOUR * TABLE_SIZE : (FIRST_COLOUR + 1) * TABLE_SIZE]
    for k in range(frames.shape[0]):
        picture = Picture(frames[k], first, palette.tables, palette.colour_of)
        cylinder = follow_encoder(run.cylinder, times[k], encoders[k])
        filled, guide = extend_path(setup, tracks.path, run, cylinder.angle, guides[k])
        cable = LaidCable(tracks.marks, tracks.path, filled)
        run = _update_frame(picture, setup, run, cylinder, guide, leads[k], cable, tracks, out, k)
        out.angle[k] = run.cylinder.angle
    return run


@called
def _update_frame(
    picture: Picture,
    setup: Setup,
    run: Run,
    cylinder: Cylinder,
    guide: float,
    lead: float,
    cable: LaidCable,
    tracks: Tracks,
    out: Output,
    k: int,
) -> Run:  # pragma: no cover
    """Measure the known markers of frame k, look for the others, and return the run after it.

    Args:
        picture: Frame and colours.
        setup: Machine and camera.
        run: Before the frame.
        cylinder: At the frame.
        guide: Guide position at the frame [m].
        lead: See `update_burst`.
        cable: As laid at the frame.
        tracks: Written in place.
        out: Receives what the frame yields.
        k: Number of the frame.
    """
    marks = tracks.marks
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
    update_means(marks, expected.outcome, out, k, turned)
    if not marks.known.all():
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
    write_results(setup, marks, expected.outcome, expected.touching, turned, out, k)
    return Run(cylinder, shift, weight, cable.filled, guide)


@called
def _empty_expected(count: int) -> Expected:  # pragma: no cover
    """Return room for what is expected of a number of markers, all of them out of sight."""
    return Expected(
        outcome=np.full(count, OUT_OF_SIGHT),
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
        if abs(away) > setup.usable_azimuth:
            continue
        slope = corrected_height(cable, theta)[1]
        azimuth += turned_since(setup, shutter, azimuth, z)
        band = band_beside_turns(setup, cable, azimuth, theta, z, slope)
        expected.pixels[n] = predict_gate(setup, band, gates, n)
        expected.outcome[n] = gate_visibility(setup, gates, n, picture)
        expected.azimuth[n], expected.slope[n] = azimuth, slope
        expected.low[n], expected.high[n] = band.low, band.high
        expected.below[n], expected.above[n] = band.below, band.above
    for n in range(count):
        for m in range(n + 1, count):
            seen = expected.outcome[n] != OUT_OF_SIGHT and expected.outcome[m] != OUT_OF_SIGHT
            if seen and separate_gates(gates, n, m):
                expected.touching[n] = expected.touching[m] = True


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
    area = marks.area[n]
    if several_colours(picture):
        picture = seeking(picture, picture.colour_of[n])
    azimuth, z, found = math.nan, math.nan, NOTHING
    for attempt in range(2):
        found = measure_band(picture, setup, gates, n, place, pixels, area, WHOLE_AREA)
        if found.outcome == HIDDEN:
            return found.outcome
        azimuth, z = found.azimuth, found.z
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
    marks.area[n] *= 1.0 + AREA_SHARE * (found.share - 1.0)
    out.azimuth[k, n] = azimuth - turned_since(setup, shutter, azimuth, z)
    out.seen_height[k, n], out.slope[k, n] = z, band.slope
    out.low[k, n], out.high[k, n] = band.low, band.high
    if found.outcome == PARTLY:
        out.sigma_theta[k, n], out.sigma_height[k, n] = found.azimuth_factor, found.z_factor
    return found.outcome
