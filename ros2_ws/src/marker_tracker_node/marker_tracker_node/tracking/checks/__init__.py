"""Former place of `tracking.camera_clock`."""
