"""Compile the tracker's kernels ahead of the first real frame."""

from __future__ import annotations

import numpy as np

from marker_tracker_node.camera.pinhole import PinholeCamera
from marker_tracker_node.detection.band import Band, solve_band
from marker_tracker_node.tracking.config import TrackerConfig
from marker_tracker_node.tracking.tracker import Tracker
from winding_core import image_formats


def warm_up(config: TrackerConfig) -> None:
    """Track one black picture of a plain camera and forget it."""
    matrix = np.array([[900.0, 0.0, 32.0], [0.0, 900.0, 24.0], [0.0, 0.0, 1.0]])
    camera = PinholeCamera.from_info(width=64, height=48, k=matrix, d=np.zeros(5))
    # The search for P0 asks from Python.
    solve_band(camera.view(config.pose), config.body, 0.0, 0.0, Band(0.5, 0.0, 0.0))
    image_formats.warm_up()
    Tracker(config, camera).track(np.zeros((48, 64, 3), dtype=np.uint8), 0.0, 0.0, 0.0)
