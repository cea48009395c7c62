"""Compile the tracker's kernels ahead of the first real frame."""

from __future__ import annotations

import numpy as np

from marker_tracker_node.camera.pinhole import PinholeCamera
from marker_tracker_node.tracking.config import TrackerConfig
from marker_tracker_node.tracking.tracker import Tracker


def warm_up(config: TrackerConfig) -> None:
    """Track one black picture of a plain camera and forget it."""
    matrix = np.array([[900.0, 0.0, 32.0], [0.0, 900.0, 24.0], [0.0, 0.0, 1.0]])
    camera = PinholeCamera.from_info(width=64, height=48, k=matrix, d=np.zeros(5))
    Tracker(config, camera).track(np.zeros((48, 64, 3), dtype=np.uint8), 0.0, 0.0, 0.0)
