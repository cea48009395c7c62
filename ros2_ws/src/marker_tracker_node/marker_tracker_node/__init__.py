"""Measurement: marker positions from camera frames and encoder readings. Core without ROS."""

from marker_tracker_node.camera.pinhole import CameraPose, PinholeCamera
from marker_tracker_node.detection.colour import ColourModel, ColourRefusedError
from marker_tracker_node.tracking.config import TrackerConfig
from marker_tracker_node.tracking.refinement import Refinement, Sightings, refine
from marker_tracker_node.tracking.report import FrameFault, TrackerReport
from marker_tracker_node.tracking.tracker import Tracker

__all__ = [
    "CameraPose",
    "ColourModel",
    "ColourRefusedError",
    "FrameFault",
    "PinholeCamera",
    "Refinement",
    "Sightings",
    "Tracker",
    "TrackerConfig",
    "TrackerReport",
    "refine",
]
