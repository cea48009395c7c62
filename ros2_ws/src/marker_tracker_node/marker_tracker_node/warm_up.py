"""Compiles the kernels before a run: pictures that show nothing are measured and forgotten."""

import numpy as np

from marker_tracker_node.camera.pinhole import CameraPose, PinholeCamera
from marker_tracker_node.detection.band import Band, solve_band
from marker_tracker_node.detection.gate import empty_gates
from marker_tracker_node.lay.lay_follower import lay_config
from marker_tracker_node.lay.lay_tracker import LayReading, LayTracker
from marker_tracker_node.lay.turn_map import TurnMap
from marker_tracker_node.tracking.config import TrackerConfig
from marker_tracker_node.tracking.estimator.pictures import band_pictures, seen_again
from marker_tracker_node.tracking.frame.gate_prediction import predict_gate
from marker_tracker_node.tracking.tracker import Tracker


def warm_up(config: TrackerConfig, *, lay: bool) -> None:
    """Compile what a run needs, with the lay or without it."""
    matrix = np.array([[900.0, 0.0, 32.0], [0.0, 900.0, 24.0], [0.0, 0.0, 1.0]])
    camera = PinholeCamera(width=64, height=48, k=matrix, d=np.zeros(5))
    black = np.zeros((48, 64, 3), dtype=np.uint8)
    Tracker(config, camera).track(black, 0.0, 0.0, 0.0)
    # These are asked from Python, once P0 or a marker has passed.
    setup = config.setup(camera.view(config.pose))
    solve_band(setup.camera, setup.body, 0.0, 0.0, Band(0.5, 0.0, 0.0))
    predict_gate(setup, Band(0.0, 0.0, 0.0), empty_gates(1), 0)
    band_pictures(setup.camera, setup.body, setup.body, np.zeros((1, 7)))
    seen_again(setup.camera, setup.body, setup.camera, setup.body, np.zeros((1, 7)))
    if lay:
        # Wherever the real one stands, this one looks at the contact line.
        follower = LayTracker(lay_config(config, CameraPose()), camera)
        follower.take(black, LayReading(cylinder_angle=0.0))
        TurnMap().near(0.0, 0.1, 0.0)
