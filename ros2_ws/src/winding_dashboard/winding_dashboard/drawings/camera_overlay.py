"""What is drawn over the camera's picture: frames around the bands, and the measured turns."""

from __future__ import annotations

from winding_dashboard.drawings.band_overlay import band_overlay
from winding_dashboard.drawings.lay_overlay import lay_overlay
from winding_dashboard.state.view_state import TOGETHER, ViewState


def camera_overlay(state: ViewState) -> str:
    """Return SVG in the picture's pixels; nothing where markers are of another moment."""
    tracked = state.times["tracked"]
    if state.camera is None or not state.picture:
        return ""
    if not abs(state.picture_time - tracked) <= TOGETHER:
        return ""
    # Pictures come as seen, markers some milliseconds later; the cylinder turned meanwhile.
    bands = band_overlay(
        state.tracked,
        state.camera,
        cable_radius=state.cable_radius,
        turned=state.turned(tracked, state.picture_time),
    )
    turned = state.turned(state.lay_time, state.picture_time)
    return lay_overlay(state.lay, state.camera, turned=turned) + bands
