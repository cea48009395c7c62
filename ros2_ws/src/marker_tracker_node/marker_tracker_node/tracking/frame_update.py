"""One frame: from an image and an encoder reading to every marker's wound angle and height."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.camera.compiled import compiled
from marker_tracker_node.detection.gate import GATE_SIZE
from marker_tracker_node.tracking.band_measurement import (
    CLIPPED,
    HIDDEN,
    MEASURED,
    OUT_OF_SIGHT,
    WHOLE_AREA,
    in_picture,
    measure,
    share_between,
)
from marker_tracker_node.tracking.gate_prediction import aim, extend_path, neighbours, seen_height
from marker_tracker_node.tracking.marker_acquisition import search
from marker_tracker_node.tracking.state import (
    ALONG,
    ANGLE,
    AREA,
    BLIND,
    HEIGHT,
    MISSES,
    O_AZIMUTH,
    O_FLAGS,
    O_HEIGHT,
    O_HIGH,
    O_LOW,
    O_SEEN,
    O_SIGMA_HEIGHT,
    O_SIGMA_THETA,
    O_SLOPE,
    O_THETA,
    RATE,
    RECENT,
    REFERENCE,
    RHO,
    SHIFT,
    SHIFT_WEIGHT,
    SLIP,
    STARTED,
    STATUS,
    THETA,
    TIME,
    USABLE,
    VAR_HEIGHT,
    VAR_THETA,
    WEIGHT,
    WRAPS,
)
from winding_core.markers import MarkerFlag

FloatArray = NDArray[np.float64]
ByteArray = NDArray[np.uint8]

FLAG_OCCLUDED = int(MarkerFlag.OCCLUDED)
FLAG_CLIPPED = int(MarkerFlag.CLIPPED)
FLAG_TOUCHING = int(MarkerFlag.TOUCHING)
FLAG_SLIPPED = int(MarkerFlag.SLIPPED)
FLAG_NOT_WOUND = int(MarkerFlag.NOT_WOUND)
FLAG_PREDICTED = int(MarkerFlag.PREDICTED)

# Frames that a run mean remembers; without an end it could not follow a slip.
MEMORY = 400.0
REFERENCE_FRAMES = 20.0
RECENT_SHARE = 0.1
VARIANCE_SHARE = 0.05
AREA_SHARE = 0.05
SHIFT_SHARE = 0.02
# A wound angle that leans on the encoder carries the camera's tilt and counts less.
ENCODER_TRUST = 0.2
JUMP_THETA = 0.12
JUMP_HEIGHT = 1.5e-3
# Bounds of what is expected of a cylinder whose encoder is out [rad/s, s].
FASTEST = 100.0
LONGEST_GUESS = 10.0
LOCK_GAIN = 0.5
REAIM = 0.4


@compiled
def cylinder_angle(
    config: FloatArray, shared: FloatArray, t: float, encoder: float
) -> float:  # pragma: no cover
    """Return the cylinder angle [rad] of a frame: the encoder without its wraps, or predicted.

    Args:
        config: See `TrackerConfig.numbers`.
        shared: See `state`.
        t: Time [s].
        encoder: Angle [rad]; nan while it is missing.
    """
    turn = 2.0 * math.pi
    if shared[STARTED] == 0.0:
        shared[RATE] = 0.0
        shared[BLIND] = 0.0 if math.isfinite(encoder) else 1.0
        return encoder if math.isfinite(encoder) else 0.0
    passed = t - shared[TIME]
    expected = shared[ANGLE] + shared[RATE] * min(passed, LONGEST_GUESS)
    if not math.isfinite(encoder):
        shared[BLIND] = 1.0
        return float(expected)
    lost = turn * round((expected - encoder - shared[WRAPS]) / turn)
    shared[WRAPS] += lost
    angle = encoder + shared[WRAPS]
    if shared[BLIND] == 0.0:
        rate = shared[RATE] + 0.3 * ((angle - shared[ANGLE]) / passed - shared[RATE])
        shared[RATE] = min(max(rate, -FASTEST), FASTEST)
    shared[BLIND] = 0.0
    return float(angle)


@compiled
def advance(
    frame: ByteArray,
    table: ByteArray,
    view: FloatArray,
    config: FloatArray,
    shared: FloatArray,
    marks: FloatArray,
    candidates: FloatArray,
    path: FloatArray,
    t: float,
    encoder: float,
    guide: float,
    out: FloatArray,
) -> None:  # pragma: no cover
    """Advance the state by one frame and write what it yields.

    Args:
        frame: Shape (rows, columns, 3).
        table: See `gate_moments`.
        view: See `PinholeCamera.numbers`.
        config: See `TrackerConfig.numbers`.
        shared: See `state`.
        marks: See `state`.
        candidates: See `state`.
        path: See `TrackerState.path`.
        t: Time [s], later than the last.
        encoder: Cylinder angle [rad]; nan while the encoder is missing.
        guide: Guide position [m]; nan to expect the commanded feed.
        out: See `state`, shape (markers, OUTPUT_SIZE).
    """
    rows, columns = frame.shape[:2]
    count = marks.shape[0]
    angle = cylinder_angle(config, shared, t, encoder)
    extend_path(config, shared, path, angle, guide)
    shared[ANGLE], shared[TIME], shared[STARTED] = angle, t, 1.0
    turned = angle + shared[SHIFT]

    gates = np.zeros((count + 1, GATE_SIZE))
    order = np.zeros(count, dtype=np.int64)
    known = 0
    came = np.zeros(count, dtype=np.int64)
    aimed = np.zeros((count, 4))
    beside = np.empty((count, 4))
    for n in range(count):
        came[n] = OUT_OF_SIGHT
        if marks[n, STATUS] == 0.0:
            continue
        azimuth = turned - marks[n, RECENT]
        if n > 0 and azimuth < 0.0:
            continue
        away = azimuth - 2.0 * math.pi * round(azimuth / (2.0 * math.pi))
        if abs(away) > config[USABLE]:
            continue
        slope = seen_height(shared, marks, path, marks[n, RECENT])[1]
        neighbours(
            config, shared, marks, path, azimuth, marks[n, RECENT], marks[n, HEIGHT], slope,
            beside[n],
        )  # fmt: skip
        expected = aim(view, config, azimuth, marks[n, HEIGHT], slope, beside[n], gates[known])
        came[n] = in_picture(view, config, gates[known], rows, columns)
        if came[n] == OUT_OF_SIGHT:
            continue
        aimed[n, 0], aimed[n, 1], aimed[n, 2] = azimuth, slope, expected
        order[known] = n
        known += 1
    for i in range(known):
        for j in range(i + 1, known):
            if share_between(gates, i, j):
                aimed[order[i], 3], aimed[order[j], 3] = 1.0, 1.0

    found = np.full((count, 2), math.nan)
    out[:, O_AZIMUTH:] = math.nan
    for i in range(known):
        n = order[i]
        if came[n] == CLIPPED:
            continue
        came[n], azimuth, z, share = measure(
            frame, table, view, config, gates[i], aimed[n, 2] * marks[n, AREA],
            aimed[n, 0], marks[n, HEIGHT], aimed[n, 1], beside[n],
            WHOLE_AREA,
        )  # fmt: skip
        if came[n] != MEASURED:
            continue
        if abs(azimuth - aimed[n, 0]) * config[RHO] > REAIM * config[ALONG]:
            # Far from where it was expected the gate may have cut the band: look again.
            ahead, behind = gates[i, 4], gates[i, 8]
            expected = aim(view, config, azimuth, z, aimed[n, 1], beside[n], gates[i])
            gates[i, 4], gates[i, 8] = min(gates[i, 4], ahead), min(gates[i, 8], behind)
            came[n], azimuth, z, share = measure(
                frame, table, view, config, gates[i], expected * marks[n, AREA],
                azimuth, z, aimed[n, 1], beside[n], WHOLE_AREA,
            )  # fmt: skip
            if came[n] != MEASURED:
                continue
        if abs(azimuth - aimed[n, 0]) > JUMP_THETA or abs(z - marks[n, HEIGHT]) > JUMP_HEIGHT:
            came[n] = HIDDEN
            continue
        marks[n, AREA] *= 1.0 + AREA_SHARE * (share - 1.0)
        found[n, 0], found[n, 1] = azimuth, z
        out[n, O_AZIMUTH], out[n, O_SEEN], out[n, O_SLOPE] = azimuth, z, aimed[n, 1]
        out[n, O_LOW], out[n, O_HIGH] = beside[n, 0], beside[n, 1]

    if shared[BLIND] > 0.0:
        turned = _phase_lock(config, shared, marks, found, turned)
    _update(config, shared, marks, found, turned)
    if _unknown(marks):
        search(
            frame, table, view, config, shared, marks, candidates, path, gates, known,
            shared[ANGLE],
        )  # fmt: skip
    _write(config, marks, found, came, aimed, turned, out)


@compiled
def _unknown(marks: FloatArray) -> bool:  # pragma: no cover
    return bool((marks[:, STATUS] == 0.0).any())


@compiled
def _phase_lock(
    config: FloatArray, shared: FloatArray, marks: FloatArray, found: FloatArray, turned: float
) -> float:  # pragma: no cover
    """Correct a predicted cylinder angle by the markers in sight and return it, shifted.

    P0 alone decides when it is in sight: all wound angles are counted from it.
    """
    total, weight = 0.0, 0.0
    for n in range(marks.shape[0]):
        if math.isfinite(found[n, 0]):
            error = found[n, 0] + marks[n, THETA] - turned
            if n == 0:
                total, weight = error, 1.0
                break
            total += error
            weight += 1.0
    if weight == 0.0:
        return turned
    error = total / weight
    shared[ANGLE] += LOCK_GAIN * error
    return turned + LOCK_GAIN * error


@compiled
def _update(
    config: FloatArray, shared: FloatArray, marks: FloatArray, found: FloatArray, turned: float
) -> None:  # pragma: no cover
    """Take what was found into the run means; `found` becomes wound angle and height."""
    with_p0 = math.isfinite(found[0, 0])
    base = found[0, 0] if with_p0 else turned
    if with_p0 and shared[BLIND] == 0.0:
        shared[SHIFT_WEIGHT] += 1.0
        gain = max(1.0 / shared[SHIFT_WEIGHT], SHIFT_SHARE)
        shared[SHIFT] += gain * (base - turned)
    for n in range(marks.shape[0]):
        if not math.isfinite(found[n, 0]):
            continue
        theta = base - found[n, 0]
        found[n, 0] = theta
        trust = 1.0 if with_p0 else ENCODER_TRUST
        marks[n, WEIGHT] = min(marks[n, WEIGHT] + trust, MEMORY)
        part = trust / marks[n, WEIGHT]
        d_theta, d_height = theta - marks[n, THETA], found[n, 1] - marks[n, HEIGHT]
        marks[n, THETA] += part * d_theta
        marks[n, HEIGHT] += part * d_height
        marks[n, VAR_THETA] += VARIANCE_SHARE * (d_theta * d_theta - marks[n, VAR_THETA])
        marks[n, VAR_HEIGHT] += VARIANCE_SHARE * (d_height * d_height - marks[n, VAR_HEIGHT])
        marks[n, RECENT] += RECENT_SHARE * (theta - marks[n, RECENT])
        if marks[n, WEIGHT] <= REFERENCE_FRAMES:
            marks[n, REFERENCE] = marks[n, THETA]


@compiled
def _write(
    config: FloatArray,
    marks: FloatArray,
    found: FloatArray,
    came: NDArray[np.int64],
    aimed: FloatArray,
    turned: float,
    out: FloatArray,
) -> None:  # pragma: no cover
    """Write wound angle and height from P0, their deviations and the flags."""
    base = found[0, 1] if math.isfinite(found[0, 1]) else marks[0, HEIGHT]
    for n in range(marks.shape[0]):
        if marks[n, STATUS] == 0.0 or (n > 0 and turned < marks[n, RECENT]):
            out[n, :O_FLAGS] = math.nan
            out[n, O_FLAGS] = FLAG_NOT_WOUND
            continue
        flags = 0
        measured = math.isfinite(found[n, 0])
        if measured:
            out[n, O_THETA], out[n, O_HEIGHT] = found[n, 0], found[n, 1] - base
            marks[n, MISSES] = 0.0
            share = 1.0
        else:
            flags |= FLAG_PREDICTED
            out[n, O_THETA] = marks[n, THETA]
            out[n, O_HEIGHT] = marks[n, HEIGHT] - marks[0, HEIGHT]
            share = 1.0 / math.sqrt(marks[n, WEIGHT])
            if came[n] == CLIPPED:
                flags |= FLAG_CLIPPED
            if came[n] == HIDDEN:
                flags |= FLAG_OCCLUDED
                marks[n, MISSES] += 1.0
        out[n, O_SIGMA_THETA] = math.sqrt(marks[n, VAR_THETA]) * share
        out[n, O_SIGMA_HEIGHT] = math.sqrt(marks[n, VAR_HEIGHT]) * share
        if aimed[n, 3] > 0.0:
            flags |= FLAG_TOUCHING
        if abs(marks[n, RECENT] - marks[n, REFERENCE]) > config[SLIP]:
            flags |= FLAG_SLIPPED
        out[n, O_FLAGS] = flags
