"""How cylinder and guide advance with their readings, frame by frame and before the first one."""

from __future__ import annotations

import math
from array import array

import numpy as np

from marker_tracker_node.arrays import FloatArray
from marker_tracker_node.tracking.frame.laid_path import extend_paths
from marker_tracker_node.tracking.state import (
    Cylinder,
    FixedNumbers,
    Guide,
    Marks,
    Rows,
    Run,
    Setup,
    TrackerState,
    setup_of,
)
from winding_core.compiling import called, compiled

# No more than 160 turns are expected of a cylinder between two frames, or while its encoder is out
# [rad]: each of them is looked at.
MOST_GUESS = 1.0e3
# Share of an error that a prediction takes in a frame.
GAIN = 0.3
# The reading of a machine that has not turned so far [rad] tells the guide's place where P0 lands.
STILL = 0.003


@compiled
def lost_turns(step: float, expected: float) -> float:  # pragma: no cover
    """Return the turns [rad] that an encoder lost by wrapping in a step of its readings [rad].

    A step that a continuous encoder can have made, at any speed from standing to the expected one
    [rad], is never a wrap: a machine may have paused, and nothing needs to be invented then.
    """
    if min(expected, 0.0) - math.pi <= step <= max(expected, 0.0) + math.pi:
        return 0.0
    turn = math.tau
    return turn * round((expected - step) / turn)


@called
def follow_encoder(cylinder: Cylinder, t: float, encoder: float) -> None:  # pragma: no cover
    """Advance the cylinder to time t [s]: by the encoder without its wraps, or by its last speed.

    The encoder's angle is nan while it is missing [rad].
    """
    blind = not math.isfinite(encoder)
    if not cylinder.started:
        cylinder.angle = 0.0 if blind else encoder
        cylinder.rate = 0.0
        cylinder.read = encoder
    else:
        passed = t - cylinder.time
        expected = cylinder.angle + min(max(cylinder.rate * passed, -MOST_GUESS), MOST_GUESS)
        if blind:
            cylinder.angle = expected
        else:
            if math.isfinite(cylinder.read):
                step = encoder + cylinder.wraps - cylinder.read
                cylinder.wraps += lost_turns(step, expected - cylinder.read)
            angle = encoder + cylinder.wraps
            if not cylinder.blind:
                rate = (angle - cylinder.angle) / passed
                cylinder.rate += GAIN * (rate - cylinder.rate)
            cylinder.angle = cylinder.read = angle
    cylinder.time = t
    cylinder.started = True
    cylinder.blind = blind


@called
def phase_lock(marks: Marks, azimuths: FloatArray, turned: float) -> float:  # pragma: no cover
    """Return the correction of a predicted cylinder angle `turned` by the markers in sight [rad].

    Azimuths are those seen, nan where not, shape (markers,). P0 alone decides when it is in sight:
    all wound angles are counted from it.
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
    return GAIN * (total / weight) if weight > 0.0 else 0.0


@called
def follow_guide(
    setup: Setup, guide: Guide, cylinder: Cylinder, step: float, reading: float
) -> None:  # pragma: no cover
    """Advance the guide to a frame: by its readings, whose zero is unknown, or by the feed.

    Since the last frame the cylinder has turned by a step [rad]; the guide's reading is nan to
    expect the commanded feed [m].
    """
    way = guide.way + setup.advance_per_radian * step
    if not math.isfinite(reading) or (cylinder.blind and not math.isfinite(guide.zero)):
        guide.way = way
        return
    if not math.isfinite(guide.zero):
        # P0 may have landed before: the feed was the commanded one then.
        guide.zero = reading - way
    elif abs(guide.turned) + abs(step) < STILL:
        guide.turned += step
        guide.zero = reading - way
    else:
        guide.turned += step
        # Beside a cylinder that stands the guide may be put anywhere.
        if step != 0.0:
            guide.travel += reading - guide.reading
        way = reading - guide.zero
    guide.way = way
    guide.reading = reading


@called
def advance_machine(
    setup: Setup, run: Run, paths: FloatArray, t: float, encoder: float, reading: float
) -> None:  # pragma: no cover
    """Advance cylinder, guide and expected paths, see `Tracks` [m], to time t [s].

    The encoder's angle [rad], from P0 on, and the guide's reading [m] are nan where missing.
    """
    angle, way = run.cylinder.angle, run.guide.way
    follow_encoder(run.cylinder, t, encoder)
    follow_guide(setup, run.guide, run.cylinder, run.cylinder.angle - angle, reading)
    extend_paths(setup, paths, run, angle, way)


class MotionBefore:
    """What the machine has done before the state is a fresh one.

    Without it a guide that goes ahead of the commanded feed is taken for one whose zero is
    elsewhere, and a long way for a wrap of the encoder.

    Args:
        earlier: Ascending times [s], encoder readings [rad] and guide positions [m], nan where
            missing, before the first frame, shape (3, n); None for nothing.
    """

    def __init__(self, earlier: FloatArray | None) -> None:
        self._earlier = np.empty((3, 0)) if earlier is None else earlier
        self._frames = array("d")

    def add(self, t: float, angle: float, guide: float) -> None:
        """Take the readings of a frame, time [s], encoder [rad], guide [m]; nan where missing."""
        self._frames.extend((t, angle, guide))

    def take_up(self, state: TrackerState, fixed: FixedNumbers, t: float, origin: float) -> None:
        """Advance a fresh state along the motion before the next frame's time t [s].

        The encoder reads `origin` where P0 lands [rad].
        """
        frames = np.array(self._frames).reshape(-1, 3).T
        since = frames[0, 0] if frames.size else t
        motion = np.hstack([self._earlier[:, self._earlier[0] < since], frames])
        motion[1] -= origin
        _follow_motion(fixed, state.run_rows, state.paths, motion)


@compiled
def _follow_motion(
    fixed: FixedNumbers, run_rows: Rows, paths: FloatArray, motion: FloatArray
) -> None:  # pragma: no cover
    """Advance run and paths of a state; angles are counted from P0 on."""
    setup, run = setup_of(fixed), run_rows[0]
    for k in range(motion.shape[1]):
        advance_machine(setup, run, paths, motion[0, k], motion[1, k], motion[2, k])
