"""Former place of `tracking.camera_clock`, for packages that still import it from here."""

from marker_tracker_node.tracking.camera_clock import CameraClock, ClockSettings

__all__ = ["CameraClock", "ClockSettings"]
