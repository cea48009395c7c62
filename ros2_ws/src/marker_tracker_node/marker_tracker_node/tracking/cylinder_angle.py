"""The cylinder's angle: from the encoder, or from the markers while that is missing."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.tracking.state import Cylinder, Marks
from winding_core.compiling import called, compiled

FloatArray = NDArray[np.float64]

# Bounds of what is expected of a cylinder whose encoder is out [rad/s, s].
FASTEST = 100.0
LONGEST_GUESS = 10.0
RATE_SHARE = 0.3
LOCK_GAIN = 0.5


@compiled
def lost_turns(step: float, expected: float) -> float:  # pragma: no cover
    """Return the turns [rad] that an encoder lost by wrapping between two readings.

    A step that a continuous encoder can have made, at any speed from standing to the present
    one, is never a wrap: a machine may have paused, and nothing needs to be invented then.

    Args:
        step: Difference of the readings [rad].
        expected: Step at the speed before [rad].
    """
    if min(expected, 0.0) - math.pi <= step <= max(expected, 0.0) + math.pi:
        return 0.0
    turn = 2.0 * math.pi
    return turn * round((expected - step) / turn)


@called
def follow_encoder(before: Cylinder, t: float, encoder: float) -> Cylinder:  # pragma: no cover
    """Return the cylinder at a frame: the encoder without its wraps, or predicted.

    Args:
        before: In the last frame.
        t: Time [s].
        encoder: Angle [rad]; nan while it is missing.
    """
    blind = not math.isfinite(encoder)
    if not before.started:
        return Cylinder(0.0 if blind else encoder, t, 0.0, before.wraps, True, blind, encoder)
    passed = t - before.time
    expected = before.angle + before.rate * min(passed, LONGEST_GUESS)
    if blind:
        return Cylinder(expected, t, before.rate, before.wraps, True, blind, before.read)
    wraps = before.wraps
    if math.isfinite(before.read):
        wraps += lost_turns(encoder + wraps - before.read, expected - before.read)
    angle = encoder + wraps
    rate = before.rate
    if not before.blind:
        rate += RATE_SHARE * ((angle - before.angle) / passed - rate)
        rate = min(max(rate, -FASTEST), FASTEST)
    return Cylinder(angle, t, rate, wraps, True, blind, angle)


@called
def phase_lock(marks: Marks, azimuths: FloatArray, turned: float) -> float:  # pragma: no cover
    """Return the correction of a predicted cylinder angle by the markers in sight [rad].

    P0 alone decides when it is in sight: all wound angles are counted from it.

    Args:
        marks: The markers.
        azimuths: As seen in this frame [rad], nan where not, shape (markers,).
        turned: Predicted angle as the camera sees it [rad].
    """
    total, weight = 0.0, 0.0
    for n in range(azimuths.size):
        if math.isfinite(azimuths[n]):
            error = azimuths[n] + marks.theta[n] - turned
            if n == 0:
                total, weight = error, 1.0
                break
            total += error
            weight += 1.0
    return LOCK_GAIN * (total / weight) if weight > 0.0 else 0.0
