"""The 3-D view: turning cylinder, predicted cable coloured by tension, tracked markers."""

from __future__ import annotations

import math

import numpy as np
from nicegui import ui

from winding_core.markers import MarkerFlag
from winding_dashboard.views.elements import heading
from winding_dashboard.views.marker_rows import MOST_MARKERS
from winding_dashboard.views.palette import GRADIENT, INK, MEASURED, TINT
from winding_dashboard.views.shape import SCALE, scene_points
from winding_dashboard.views.view_state import ViewState

# The drum is drawn from here to there, and further when the carriage goes further [m].
_FROM, _TO, _BEYOND = -0.02, 0.125, 0.02
_MARKER_SIZE, _CABLE_SIZE = 0.9, 0.5
_LABEL = f"font:700 13px sans-serif;color:{INK};text-shadow:0 0 3px #fff,0 0 3px #fff,0 0 3px #fff"
# Frames per second that a browser draws; the data comes more slowly.
_FPS = 6


class SceneView:
    """One browser's 3-D view."""

    def __init__(self) -> None:
        with ui.element("section").classes("card grows").props('aria-label="3-D view"'):
            with ui.element("div").classes("heading-row"):
                heading("Predicted cable and tracked markers")
                with ui.element("div").classes("scale remark"):
                    self._low = ui.label("tension")
                    ui.element("div").classes("bar").style(f"background: {GRADIENT}")
                    self._high = ui.label("N")
            with ui.element("div").classes("scene"):
                self._scene = ui.scene(
                    grid=False,
                    background_color=TINT,
                    camera=ui.scene.perspective_camera(fov=36),
                    click_events=[],
                    fps=_FPS,
                )
        with self._scene as scene:
            with scene.group() as self._drum:
                scene.cylinder(1.0, 1.0, 1.0, 64).rotate(0.0, 0.0, 0.5 * math.pi).material(
                    "#c9d0d8"
                )
                # The line of P0, so that one sees it turn.
                scene.box(1.0, 0.05, 0.05).move(0.0, -1.0, 0.0).material("#7b8794")
            self._drum.visible(False)
            self._cable = scene.point_cloud([[0.0, 0.0, 0.0]], [[0.0, 0.0, 0.0]], _CABLE_SIZE)
            self._cable.visible(False)
            self._markers = scene.point_cloud([[0.0, 0.0, 0.0]], None, _MARKER_SIZE)
            self._markers.material(MEASURED)
            self._markers.visible(False)
            self._names = [scene.text(f"P{n}", _LABEL) for n in range(MOST_MARKERS + 1)]
            for name in self._names:
                name.visible(False)
        scene.move_camera(
            x=2.8, y=-14.0, z=4.8, look_at_x=5.2, look_at_y=0.0, look_at_z=0.9, duration=0.0
        )
        self._drawn = ""
        self._size: tuple[float, float] = (0.0, 0.0)

    def update(self, state: ViewState) -> None:
        """Draw the newest positions."""
        drawn = f"{state.time}"
        if drawn == self._drawn:
            return
        self._drawn = drawn
        self._update_drum(state)
        self._update_cable(state)
        self._update_markers(state)

    def _update_drum(self, state: ViewState) -> None:
        radius = state.centreline_radius - state.cable_radius
        if state.axes is None or not radius > 0.0:
            self._drum.visible(False)
            return
        end = max(_TO, state.axes.carriage_position + _BEYOND)
        if self._size != (radius, end):
            self._size = (radius, end)
            self._drum.scale(SCALE * (end - _FROM), SCALE * radius, SCALE * radius)
            self._drum.move(SCALE * 0.5 * (end + _FROM), 0.0, 0.0)
        # The scene's x is the lab's z: one and the same turn.
        self._drum.rotate(math.remainder(state.drum_angle, math.tau), 0.0, 0.0)
        self._drum.visible()

    def _update_cable(self, state: ViewState) -> None:
        shape = state.cable_shape()
        if shape is None:
            self._cable.visible(False)
            return
        self._cable.set_points(
            np.round(shape.points, 3).tolist(), np.round(shape.colours, 3).tolist()
        )
        self._cable.visible()
        self._low.set_text(f"tension {shape.low:.2f}")
        self._high.set_text(f"{shape.high:.2f} N")

    def _update_markers(self, state: ViewState) -> None:
        markers = state.tracked
        xyz = np.stack([markers[name] for name in ("x", "y", "z")], axis=1).astype(float)
        shown = np.isfinite(xyz).all(axis=1) & ((markers["flags"] & MarkerFlag.NOT_WOUND) == 0)
        # Dots lie on the cable's outside, or the cable would hide them.
        cosine, sine = 1.08 * math.cos(state.marker_turn), 1.08 * math.sin(state.marker_turn)
        turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        points = scene_points(xyz[shown] @ turn.T)
        self._markers.visible(bool(len(points)))
        if len(points):
            self._markers.set_points(np.round(points, 3).tolist())
        # A name floats above everything, so those behind the cylinder are left out.
        near = points[:, 1] < 0.0
        numbers = (int(n) for n in markers["id"][shown][near])
        present = dict(zip(numbers, points[near], strict=True))
        for number, name in enumerate(self._names):
            if number in present:
                x, y, z = (float(value) for value in present[number])
                # Neighbouring turns nearly touch: their names stand above and below.
                beside = 1.0 if number % 2 == 0 else -1.0
                name.move(round(x, 3), round(y, 3), round(z + beside, 3))
            name.visible(number in present)
