"""Run means of the known markers, and what a frame reports of each."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.tracking.gate_prediction import CLIPPED, HIDDEN, PARTLY
from marker_tracker_node.tracking.state import FlagArray, IndexArray, Marks, Output, Run, Setup
from winding_core.compiling import called
from winding_core.markers import MarkerFlag

FloatArray = NDArray[np.float64]

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
SHIFT_SHARE = 0.02
# A wound angle that leans on the encoder carries the camera's tilt and counts less.
ENCODER_TRUST = 0.2


@called
def update_shift(
    run: Run, blind: bool, azimuth: float, turned: float
) -> tuple[float, float]:  # pragma: no cover
    """Return the shift [rad] and its weight after a frame in which P0 may have been seen.

    Args:
        run: Before the frame.
        blind: Whether the encoder is missing.
        azimuth: Of P0 as seen [rad], nan where not.
        turned: Cylinder angle as the camera is expected to see it [rad].
    """
    if blind or not math.isfinite(azimuth):
        return run.shift, run.shift_weight
    weight = run.shift_weight + 1.0
    gain = max(1.0 / weight, SHIFT_SHARE)
    return run.shift + gain * (azimuth - turned), weight


@called
def _factor(outcome: int, factor: float) -> float:  # pragma: no cover
    """Return by how much the deviation of a mark exceeds that of one that is seen whole."""
    return float(factor) if outcome == PARTLY else 1.0


@called
def _joint(one: float, other: float) -> float:  # pragma: no cover
    """Return by how much the deviation of a difference of two measurements is larger."""
    return 1.0 if one == other == 1.0 else math.sqrt(0.5 * (one * one + other * other))


@called
def update_means(
    marks: Marks, outcome: IndexArray, out: Output, k: int, turned: float
) -> None:  # pragma: no cover
    """Take the bands measured in frame k into the run means; write their wound angles.

    Args:
        marks: The markers.
        outcome: What came of looking for each, shape (markers,).
        out: Holds azimuth and z as seen; receives the wound angle of what was measured.
        k: Number of the frame.
        turned: Cylinder angle as the camera sees it [rad].
    """
    with_p0 = math.isfinite(out.azimuth[k, 0])
    base = out.azimuth[k, 0] if with_p0 else turned
    trust = 1.0 if with_p0 else ENCODER_TRUST
    first = _factor(outcome[0], out.sigma_theta[k, 0])
    for n in range(marks.known.size):
        if not math.isfinite(out.azimuth[k, n]):
            continue
        theta = base - out.azimuth[k, n]
        out.theta[k, n] = theta
        d_theta, d_height = theta - marks.theta[n], out.seen_height[k, n] - marks.height[n]
        mine = trust
        own_theta, own_height = d_theta, d_height
        if outcome[n] == PARTLY or first > 1.0:
            # What is seen in part says less.
            factor = _joint(_factor(outcome[n], out.sigma_theta[k, n]), first)
            mine /= factor * factor
            own_theta /= factor
            own_height /= _factor(outcome[n], out.sigma_height[k, n])
        marks.weight[n] = min(marks.weight[n] + mine, MEMORY)
        part = mine / marks.weight[n]
        marks.theta[n] += part * d_theta
        marks.height[n] += part * d_height
        marks.var_theta[n] += VARIANCE_SHARE * (own_theta * own_theta - marks.var_theta[n])
        marks.var_height[n] += VARIANCE_SHARE * (own_height * own_height - marks.var_height[n])
        marks.recent[n] += RECENT_SHARE * (theta - marks.recent[n])
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

    Args:
        setup: Machine and camera.
        marks: The markers.
        outcome: What came of looking for each, shape (markers,).
        touching: Whether its band touches another, shape (markers,).
        turned: Cylinder angle as the camera sees it [rad].
        out: Holds what was measured.
        k: Number of the frame.
    """
    p0_seen = math.isfinite(out.seen_height[k, 0])
    base = out.seen_height[k, 0] if p0_seen else marks.height[0]
    first = _factor(outcome[0], out.sigma_theta[k, 0])
    # A mark that is no ring moves around the section with the cable: P0's and its own both count.
    twisted = math.sqrt(2.0) * setup.torsion * setup.body.cable_radius
    for n in range(marks.known.size):
        if not marks.known[n] or (n > 0 and turned < marks.recent[n]):
            out.theta[k, n] = out.height[k, n] = math.nan
            out.sigma_theta[k, n] = out.sigma_height[k, n] = math.nan
            out.flags[k, n] = FLAG_NOT_WOUND
            continue
        flags = 0
        share, share_z = 1.0, 1.0
        if math.isfinite(out.azimuth[k, n]):
            if outcome[n] == PARTLY or first > 1.0:
                share = _joint(_factor(outcome[n], out.sigma_theta[k, n]), first)
                share_z = _factor(outcome[n], out.sigma_height[k, n])
            out.height[k, n] = out.seen_height[k, n] - base
        else:
            flags |= FLAG_PREDICTED
            out.theta[k, n] = marks.theta[n]
            out.height[k, n] = marks.height[n] - marks.height[0]
            share = share_z = 1.0 / math.sqrt(marks.weight[n])
            if outcome[n] == CLIPPED:
                flags |= FLAG_CLIPPED
            if outcome[n] == HIDDEN:
                flags |= FLAG_OCCLUDED
        out.sigma_theta[k, n] = math.sqrt(marks.var_theta[n]) * share
        out.sigma_height[k, n] = math.hypot(math.sqrt(marks.var_height[n]) * share_z, twisted)
        if touching[n]:
            flags |= FLAG_TOUCHING
        if abs(marks.recent[n] - marks.reference[n]) > setup.slip_limit:
            flags |= FLAG_SLIPPED
        out.flags[k, n] = flags
