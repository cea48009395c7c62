"""Parts of the page that are text: figures, table of markers, resemblance, list of nodes."""

from __future__ import annotations

import base64
import math

from nicegui import ui

from winding_core.status import Level
from winding_core.units import MILLIMETRE
from winding_dashboard.views.elements import heading
from winding_dashboard.views.health import NodeHealth
from winding_dashboard.views.marker_rows import MOST_MARKERS, MarkerRow
from winding_dashboard.views.material_view import material_sentence
from winding_dashboard.views.overlay import measured_count
from winding_dashboard.views.view_state import ViewState

_DASH = "–"
_PER_METRE = 1.0 / MILLIMETRE
_MOST_NODES = 12
_FEWEST_ROWS = 4
# Votes that are shown; the others are below.
_TOLD_VOTES = 3
_LEVELS = {
    Level.OK: ("ok", "quiet"),
    Level.WARN: ("warning", "warn"),
    Level.ERROR: ("ERROR", "bad"),
    Level.STALE: ("silent", "warn"),
}


def number(value: float, digits: int, scale: float = 1.0, sign: bool = False) -> str:
    """Return value times a unit's scale with a number of decimals; a dash for nan."""
    if not math.isfinite(value):
        return _DASH
    # Minus zero is noise.
    rounded = round(scale * value, digits) + 0.0
    return f"{rounded:+.{digits}f}" if sign else f"{rounded:.{digits}f}"


class CameraPanel:
    """The camera's preview with the detected bands on it."""

    def __init__(self) -> None:
        with ui.element("section").classes("card").props('aria-label="Camera"'):
            with ui.element("div").classes("heading-row"):
                heading("Camera, with the bands that the tracker found")
                self._count = ui.label().classes("remark")
            with ui.element("div").classes("camera"):
                self._nothing = ui.label("no picture yet").classes("remark")
                self._image = ui.interactive_image(events=[]).props(
                    'alt="Camera preview" draggable=false'
                )
        self._shown: tuple[object, str] = (b"", "")

    def update(self, state: ViewState) -> None:
        """Show the newest picture."""
        overlay = state.overlay()
        if self._shown == (state.picture, overlay):
            return
        self._shown = (state.picture, overlay)
        self._nothing.set_visibility(not state.picture)
        self._image.set_visibility(bool(state.picture))
        if state.picture:
            code = base64.b64encode(state.picture).decode("ascii")
            self._image.set_source(f"data:image/jpeg;base64,{code}")
        self._image.set_content(overlay)
        self._count.set_text(
            f"{measured_count(state.tracked)} of {len(state.tracked)} measured in this frame"
        )


class Tile:
    """One big figure."""

    def __init__(self, name: str) -> None:
        with ui.element("div").classes("card tile"):
            ui.label(name).classes("name")
            self._value = ui.label(_DASH).classes("value")
            self._remark = ui.label(" ").classes("remark")

    def update(self, value: str, remark: str) -> None:
        """Show a value and the remark under it."""
        self._value.set_text(value)
        self._remark.set_text(remark)


class Figures:
    """Speeds, what the sensors measure, and how far the machine has come."""

    def __init__(self, state: ViewState) -> None:
        with ui.element("section").classes("tiles").props('aria-label="Machine"'):
            self._speed = Tile("Cylinder, rad/s")
            self._feed = Tile("Carriage, mm/s")
            self._measured = {
                quantity: Tile(f"{quantity.name.capitalize()}, {quantity.unit}")
                for quantity in state.measured
            }
            self._turns = Tile("Wound, turns")
            self._carriage = Tile("Carriage at, mm")
            self._case = Tile("Resembles case")

    def update(self, state: ViewState) -> None:
        """Show the newest readings."""
        nan = math.nan
        axes, wanted = state.axes, state.setpoints
        self._speed.update(
            number(axes.angular_speed if axes else nan, 3),
            f"set {number(wanted.angular_speed if wanted else nan, 3)}",
        )
        self._feed.update(
            number(axes.feed_speed if axes else nan, 2, _PER_METRE),
            f"set {number(wanted.feed_speed if wanted else nan, 2, _PER_METRE)}",
        )
        for quantity, tile in self._measured.items():
            value = number(state.measured[quantity], quantity.digits)
            tile.update(value, quantity.sensor.replace("_", " "))
        angle = axes.cylinder_angle if axes else nan
        self._turns.update(number(angle / math.tau, 2), f"{number(angle, 2)} rad")
        self._carriage.update(
            number(axes.carriage_position if axes else nan, 1, _PER_METRE), "guide"
        )
        best = next(iter(state.votes.items()), None)
        self._case.update(str(best[0]) if best else _DASH, _votes(state))


def _votes(state: ViewState) -> str:
    if not state.votes:
        return "nothing measured"
    told = list(state.votes.items())[:_TOLD_VOTES]
    return ", ".join(
        f"{share:.0%}" if index == 0 else f"{case}: {share:.0%}"
        for index, (case, share) in enumerate(told)
    )


class MarkerTable:
    """Curve lengths of the markers, predicted, corrected and measured."""

    def __init__(self) -> None:
        with ui.element("section").classes("card").props('aria-label="Markers"'):
            heading("Curve length from P0, mm")
            with ui.element("table").classes("plain"):
                with ui.element("thead"), ui.element("tr"):
                    for title, style in (
                        ("", ""),
                        ("before run", ""),
                        ("predicted", "is-predicted"),
                        ("corrected", "is-corrected"),
                        ("measured", "is-measured"),
                        ("state", ""),
                    ):
                        with ui.element("th").props("scope=col"):
                            ui.label(title).classes(style)
                with ui.element("tbody"):
                    self._rows = [_MarkerLine() for _ in range(MOST_MARKERS)]
            self._material = ui.label().classes("remark material").props("role=status")

    def update(self, state: ViewState) -> None:
        """Show a row for every marker; the usual four from the start."""
        self._material.set_text(material_sentence(state.material))
        rows = state.marker_rows()
        known = {row.id for row in rows}
        rows += [MarkerRow(id=n) for n in range(1, _FEWEST_ROWS + 1) if n not in known]
        rows.sort(key=lambda row: row.id)
        for index, line in enumerate(self._rows):
            line.update(rows[index] if index < len(rows) else None)


class _MarkerLine:
    def __init__(self) -> None:
        with ui.element("tr") as self._line:
            with ui.element("td"):
                self._name = ui.label()
            with ui.element("td"):
                self._ahead = ui.label()
            with ui.element("td"):
                self._predicted = ui.label().classes("is-predicted")
            with ui.element("td"):
                self._corrected = ui.label().classes("is-corrected")
                self._bounds = ui.label().classes("remark")
            with ui.element("td"):
                self._measured = ui.label().classes("is-measured")
                self._difference = ui.label().classes("remark")
            with ui.element("td"):
                self._state = ui.label()

    def update(self, row: MarkerRow | None) -> None:
        self._line.set_visibility(row is not None)
        if row is None:
            return
        self._name.set_text(f"P{row.id}")
        self._ahead.set_text(number(row.ahead, 1, _PER_METRE))
        self._predicted.set_text(number(row.predicted, 2, _PER_METRE))
        self._corrected.set_text(number(row.corrected, 2, _PER_METRE))
        low, high = number(row.low, 1, _PER_METRE), number(row.high, 1, _PER_METRE)
        self._bounds.set_text(" " if low == _DASH else f"{low}–{high}")
        self._measured.set_text(number(row.measured, 2, _PER_METRE))
        difference = number(row.difference, 2, 100.0, sign=True)
        self._difference.set_text(" " if difference == _DASH else f"{difference} %")
        self._state.set_text(row.state)


class NodeTable:
    """What every node of the graph says of itself."""

    def __init__(self) -> None:
        with ui.element("section").classes("card").props('aria-label="Nodes"'):
            heading("Nodes")
            with ui.element("table").classes("plain nodes"):
                with ui.element("thead"), ui.element("tr"):
                    for title in ("node", "lifecycle", "level", "says"):
                        with ui.element("th").props("scope=col"):
                            ui.label(title)
                with ui.element("tbody"):
                    self._rows = [_NodeLine() for _ in range(_MOST_NODES)]

    def update(self, state: ViewState, now: float) -> None:
        """Show a row for every node at wall time now [s]."""
        rows = state.health.rows(now)
        for index, line in enumerate(self._rows):
            line.update(rows[index] if index < len(rows) else None)


class _NodeLine:
    def __init__(self) -> None:
        with ui.element("tr") as self._line:
            self._cells = []
            for _ in range(4):
                with ui.element("td"):
                    self._cells.append(ui.label())
        self._style = ""

    def update(self, row: NodeHealth | None) -> None:
        self._line.set_visibility(row is not None)
        if row is None:
            return
        level, style = _LEVELS[row.level]
        for cell, text in zip(
            self._cells, (row.name, row.lifecycle or _DASH, level, row.message), strict=True
        ):
            cell.set_text(text)
        if style != self._style:
            self._cells[2].classes(replace=style)
            self._style = style
