"""The motion of a run before a tracker begins, or begins anew, in its middle."""

from __future__ import annotations

from array import array

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.tracking.cylinder_angle import follow_encoder
from marker_tracker_node.tracking.guide_readings import follow_guide
from marker_tracker_node.tracking.laid_path import extend_paths
from marker_tracker_node.tracking.state import Run
from marker_tracker_node.tracking.tracker_state import TrackerState, run_of, setup_of, write_run
from winding_core.compiling import compiled

FloatArray = NDArray[np.float64]


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

    def take_up(self, state: TrackerState, fixed: FloatArray, t: float, origin: float) -> None:
        """Advance a fresh state along the motion before a time.

        Args:
            state: Written in place.
            fixed: See `setup_numbers`, shape (38,).
            t: Of the next frame [s].
            origin: What the encoder reads where P0 lands [rad].
        """
        frames = np.array(self._frames).reshape(-1, 3).T
        since = frames[0, 0] if frames.size else t
        motion = np.hstack([self._earlier[:, self._earlier[0] < since], frames])
        motion[1] -= origin
        _follow_motion(fixed, state.numbers, state.paths, motion)


@compiled
def _follow_motion(
    fixed: FloatArray, numbers: FloatArray, paths: FloatArray, motion: FloatArray
) -> None:  # pragma: no cover
    """Advance the numbers and paths of a state; angles are counted from P0 on."""
    setup, run = setup_of(fixed), run_of(numbers)
    for k in range(motion.shape[1]):
        cylinder = follow_encoder(run.cylinder, motion[0, k], motion[1, k])
        guide = follow_guide(setup, run.guide, run.cylinder, cylinder, motion[2, k])
        filled = extend_paths(setup, paths, run, cylinder.angle, guide)
        run = Run(cylinder, guide, run.shift, run.shift_weight, filled)
    write_run(run, numbers)
