"""Compile the tracker's kernels ahead of the first real frame."""

from __future__ import annotations

import numpy as np

from marker_tracker_node.camera.pinhole import PinholeCamera
from marker_tracker_node.detection.band import Band, solve_band
from marker_tracker_node.detection.gate import TABLE_SIZE, empty_gates
from marker_tracker_node.tracking.config import TrackerConfig
from marker_tracker_node.tracking.gate_prediction import predict_gate
from marker_tracker_node.tracking.tracker import Tracker
from marker_tracker_node.tracking.tracker_state import TrackerState, setup_numbers
from marker_tracker_node.tracking.unnumbered_bands import UnnumberedBands


def warm_up(config: TrackerConfig) -> None:
    """Track one black picture of a plain camera and forget it."""
    matrix = np.array([[900.0, 0.0, 32.0], [0.0, 900.0, 24.0], [0.0, 0.0, 1.0]])
    camera = PinholeCamera.from_info(width=64, height=48, k=matrix, d=np.zeros(5))
    # The search for P0 asks from Python.
    solve_band(camera.view(config.pose), config.body, 0.0, 0.0, Band(0.5, 0.0, 0.0))
    frame = np.zeros((48, 64, 3), dtype=np.uint8)
    Tracker(config, camera).track(frame, 0.0, 0.0, 0.0)
    setup = config.setup(camera.view(config.pose))
    # P0's place and what lies between markers are asked from Python, once they are in sight.
    predict_gate(setup, Band(azimuth=0.0, z=0.0, slope=0.0), empty_gates(1), 0)
    frame.flags.writeable = False
    UnnumberedBands().look(
        frame,
        np.zeros(TABLE_SIZE, dtype=np.uint8),
        setup_numbers(setup),
        TrackerState.fresh(config.marker_count),
        1.0,
    )
