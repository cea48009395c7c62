"""What does the simulated camera see? Exact ground truth; no code shared with the tracker."""

from winding_rig_node.camera.cable_path import CablePath, GrowingPath
from winding_rig_node.camera.config import (
    CameraCalibration,
    CameraConfig,
    Light,
    SensorNoise,
    Window,
)
from winding_rig_node.camera.pictures import encode_jpeg
from winding_rig_node.camera.renderer import Renderer
from winding_rig_node.camera.scene import Paint, Patch, Scene, Surroundings, paint_of_hue

__all__ = [
    "CablePath",
    "CameraCalibration",
    "CameraConfig",
    "GrowingPath",
    "Light",
    "Paint",
    "Patch",
    "Renderer",
    "Scene",
    "SensorNoise",
    "Surroundings",
    "Window",
    "encode_jpeg",
    "paint_of_hue",
]
