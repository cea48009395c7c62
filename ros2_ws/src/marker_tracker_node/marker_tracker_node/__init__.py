"""Measurement: marker positions from camera frames and encoder readings. Core without ROS."""

from marker_tracker_node.colour import ColourModel, ColourRefusedError
from marker_tracker_node.config import TrackerConfig
from marker_tracker_node.pinhole import CameraPose, PinholeCamera
from marker_tracker_node.refinement import Refinement, Sightings, refine
from marker_tracker_node.report import FrameFault, TrackerReport
from marker_tracker_node.tracker import Tracker

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
