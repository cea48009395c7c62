"""Measurement: marker positions from camera frames and encoder readings. Core without ROS."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from marker_tracker_node.camera.calibration import read_camera
    from marker_tracker_node.camera.frame_sources import FrameSource
    from marker_tracker_node.camera.pinhole import CameraPose, PinholeCamera
    from marker_tracker_node.camera.recordings import Motion, read_motion
    from marker_tracker_node.detection.colour import ColourModel, ColourRefusedError
    from marker_tracker_node.lay.config import LayConfig
    from marker_tracker_node.lay.lay_tracker import LayReading, LayTracker
    from marker_tracker_node.lay.report import LayDefect, LayReport
    from marker_tracker_node.tracking.config import TrackerConfig
    from marker_tracker_node.tracking.refinement import PoseBelief, Refinement, Sightings, refine
    from marker_tracker_node.tracking.report import FrameFault, TrackerReport
    from marker_tracker_node.tracking.tracker import Tracker

__all__ = [
    "CameraPose",
    "ColourModel",
    "ColourRefusedError",
    "FrameFault",
    "FrameSource",
    "LayConfig",
    "LayDefect",
    "LayReading",
    "LayReport",
    "LayTracker",
    "Motion",
    "PinholeCamera",
    "PoseBelief",
    "Refinement",
    "Sightings",
    "Tracker",
    "TrackerConfig",
    "TrackerReport",
    "read_camera",
    "read_motion",
    "refine",
]

_PLACES = {
    "camera.calibration": {"read_camera"},
    "camera.frame_sources": {"FrameSource"},
    "camera.pinhole": {"CameraPose", "PinholeCamera"},
    "camera.recordings": {"Motion", "read_motion"},
    "detection.colour": {"ColourModel", "ColourRefusedError"},
    "lay.config": {"LayConfig"},
    "lay.lay_tracker": {"LayReading", "LayTracker"},
    "lay.report": {"LayDefect", "LayReport"},
    "tracking.config": {"TrackerConfig"},
    "tracking.refinement": {"PoseBelief", "Refinement", "Sightings", "refine"},
    "tracking.report": {"FrameFault", "TrackerReport"},
    "tracking.tracker": {"Tracker"},
}


def __getattr__(name: str) -> Any:
    # Who asks for the node's parameters alone is spared its kernels.
    for module, names in _PLACES.items():
        if name in names:
            return getattr(importlib.import_module(f"{__name__}.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
