"""The motion of a run before the first frame of a tracker that takes it up in the middle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.tracking.cylinder_angle import follow_encoder
from marker_tracker_node.tracking.guide_readings import follow_guide
from marker_tracker_node.tracking.laid_path import extend_paths
from marker_tracker_node.tracking.state import Run
from marker_tracker_node.tracking.tracker_state import TrackerState, run_of, setup_of, write_run
from winding_core.compiling import compiled

FloatArray = NDArray[np.float64]


def take_up(
    state: TrackerState, fixed: FloatArray, motion: FloatArray, t: float, origin: float
) -> None:
    """Advance a fresh state along the machine's motion before a time.

    Args:
        state: Written in place.
        fixed: See `setup_numbers`, shape (38,).
        motion: Ascending times [s], encoder readings [rad] and guide positions [m], shape (3, n).
        t: Of the first frame [s].
        origin: What the encoder reads where P0 lands [rad].
    """
    earlier = motion[:, motion[0] < t]
    earlier[1] -= origin
    _follow_motion(fixed, state.numbers, state.paths, earlier)


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
