"""Everything that the page shows at one moment, complete, with one sequence number.

A browser shows the newest snapshot that it has and nothing else, so what it shows belongs to one
moment however long it was away (decision 18). Single texts are in `texts`; everything else is a
part of the page that is drawn anew when it has changed.
"""

from __future__ import annotations

import base64
import math
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from winding_core.lay.errors import turn_errors
from winding_core.lay.records import ControlMode
from winding_core.parameters import shown_values
from winding_core.run_options import OperatorLimits
from winding_dashboard.drawings.arm_view import ArmView
from winding_dashboard.drawings.camera_overlay import camera_overlay, measured_count
from winding_dashboard.drawings.cylinder_view import Sight, cylinder_drawing, tension_ends
from winding_dashboard.drawings.lay_charts import (
    control_drawings,
    defect_sentence,
    lay_drawing,
    layers_drawing,
)
from winding_dashboard.drawings.run_charts import length_drawing, speed_drawings
from winding_dashboard.page import commands
from winding_dashboard.page.band import band
from winding_dashboard.page.cell import number
from winding_dashboard.page.control_card import MODES, basis_words, beliefs
from winding_dashboard.page.figures import figures, material_sentence
from winding_dashboard.page.run_list import RunList
from winding_dashboard.page.session import OperatorSession
from winding_dashboard.state.health import RECORDER, recording_sentence
from winding_dashboard.state.view_state import ViewState

# Nothing is drawn more often than this [s]; charts and lists change more slowly.
PERIOD = 0.15
_SLOW = 0.5
# Diagnostics come once a second: what was heard within this time is the present [s].
_PRESENT = 1.5
_REMEMBERED = 256
_MOST_NODES, _NEWEST_TURNS = 12, 6
# Element of each switch of the lay's controller.
_MODES = {mode: f"mode-{mode.name.lower()}" for mode in ControlMode}
# Of a camera whose picture size is not known yet [px].
_PICTURE = (800, 120)

Render = Callable[[str, dict[str, Any]], str]


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """What one browser looks at."""

    marker: int = 0  # Whose curve length is drawn; 0 for the newest marker's
    sight: Sight = field(default_factory=Sight)  # From where the cylinder is looked at


@dataclass(eq=False)
class Snapshots:
    """Makes snapshots, at most one for each period, whoever asks."""

    state: ViewState  # What is known of the run
    session: OperatorSession  # What operators asked for
    runs: RunList  # Runs with their reports
    render: Render  # Makes a part of the page from the name of its template and what it shows
    clock: Callable[[], float]  # Wall time [s] as the state's `health` gets it
    server: str  # Name of this server; another one counts from zero
    arm: ArmView = field(default_factory=ArmView)  # Draws what carries the guide

    def __post_init__(self) -> None:
        self._sequence = 0
        self._made: OrderedDict[int, float] = OrderedDict()
        self._due = -math.inf
        self._newest: dict[str, Any] = {}
        self._own: dict[Wanted, dict[str, str]] = {}
        self._slow: tuple[float, dict[str, str]] = (-math.inf, {})

    def snapshot(self, wanted: Wanted) -> dict[str, Any]:
        """Return the newest snapshot as JSON values."""
        now = self.clock()
        if now >= self._due:
            self._make(now)
        if wanted not in self._own:
            self._own[wanted] = {
                "chart-length": length_drawing(self.state, wanted.marker),
                "cylinder": cylinder_drawing(self.state, wanted.sight),
            }
        own = self._own[wanted]
        marker = wanted.marker or self.state.newest_marker()
        return {
            **self._newest,
            "texts": {**self._newest["texts"], "chart-length-title": f"S{marker}, mm"},
            "parts": {**self._newest["parts"], **own},
        }

    def changed(self) -> None:
        """Make the next snapshot anew: an operator did something."""
        self._due = -math.inf
        self._slow = (-math.inf, {})

    def age(self, server: object, sequence: object) -> float:
        """Return how old a snapshot is [s]; infinite for one that is no longer kept."""
        if server != self.server or not isinstance(sequence, int):
            return math.inf
        return self.clock() - self._made.get(sequence, -math.inf)

    def _make(self, now: float) -> None:
        state, session = self.state, self.session
        self._sequence += 1
        self._made[self._sequence], self._due = now, now + PERIOD
        while len(self._made) > _REMEMBERED:
            self._made.popitem(last=False)
        self._own = {}
        if now - self._slow[0] >= _SLOW:
            self._slow = (now, self._chart_parts() | self._list_parts(now))
        silent = now - max(state.last_data, state.health.last_heard)
        off = self._off(now)
        self._newest = {
            "server": self.server,
            "sequence": self._sequence,
            "time": state.time if math.isfinite(state.time) else None,
            "resets": state.resets,
            "age": None if math.isinf(silent) else (silent if silent > _PRESENT else 0.0),
            "texts": self._texts(now),
            "parts": self._quick_parts(now) | self._slow[1],
            "off": off,
            "ask": self._ask(now),
            "hidden": self._hidden(now, off),
            "pressed": {name: state.control.mode is mode for mode, name in _MODES.items()},
            "form": session.form(),
            "limits": shown_values(OperatorLimits, vars(session.limits())),
            "alarm": session.alarm,
            "bad": {
                "control-basis": basis_words(state.control, state.time)[1],
                "prepare-answer": bool(session.refused),
            },
            "playback": state.playback,
            "picture": base64.b64encode(state.picture).decode("ascii"),
        }

    def _texts(self, now: float) -> dict[str, str]:
        state, session = self.state, self.session
        recording = state.recording(now)
        unrecorded = session.unrecorded()
        recorded = recording_sentence(state.health.message(RECORDER), recording)
        tracked = f"{measured_count(state.tracked)} of {len(state.tracked)}"
        basis, _ = basis_words(state.control, state.time)
        return {
            "clock": f"{number(state.run_time, 1)} s",
            "answer": session.answer,
            "why-off": self._why_off(now),
            "camera-count": f"{tracked} measured in this frame",
            "record": "Stop recording" if recording.get("bag") else "Record",
            "nodes-title": "Nodes, as recorded" if state.player else "Nodes",
            "recorded": recorded if recording.get("bag") else unrecorded or recorded,
            "prepare-answer": session.preparing or session.unprepared() or session.refused,
            "control-mode": MODES[state.control.mode],
            "control-basis": basis,
            "material": material_sentence(state.material),
        }

    def _quick_parts(self, now: float) -> dict[str, str]:
        state = self.state
        return {
            "band": self.render("band", {"cells": band(state, now, self.session.preparing)}),
            "alerts": self.render("alerts", {"warnings": state.health.warnings(now)}),
            "figures": self.render("figures", {"figures": figures(state)}),
            "markers": self.render("markers", {"rows": state.marker_rows(), "old": state.old}),
            "overlay": self.render(
                "overlay", {"size": _picture_size(state), "drawing": camera_overlay(state)}
            ),
            "tension-scale": self.render("scale", {"ends": tension_ends(state)}),
            "arm": self.arm.svg(state),
        }

    def _chart_parts(self) -> dict[str, str]:
        state, tolerance = self.state, self.session.limits().lay_tolerance
        parts = speed_drawings(state)
        if state.control.known:
            turns = turn_errors(state.lay, state.control.wanted)[-_NEWEST_TURNS:]
            parts |= control_drawings(state, tolerance)
            if state.control.layer_turns:
                parts["chart-layers"] = layers_drawing(state)
            parts["turns"] = self.render(
                "turns", {"turns": turns, "tolerance": tolerance, "facts": beliefs(state.control)}
            )
        elif len(state.lay):
            parts["chart-helix"] = lay_drawing(state.lay, state.advance)
            parts["defects"] = self.render("text", {"text": defect_sentence(state.lay)})
        return parts

    def _list_parts(self, now: float) -> dict[str, str]:
        return {
            "nodes": self.render("nodes", {"rows": self.state.health.rows(now)[:_MOST_NODES]}),
            "runs": self.render("runs", {"runs": self.runs.runs()}),
            "others": self.render("others", {"rows": sorted(self.state.others.items())}),
            "recipes": self.render("recipes", {"names": self.session.recipes.names()}),
        }

    def _off(self, now: float) -> dict[str, str]:
        session = self.session
        off = {name: session.unavailable(name, now) for name in commands.MACHINE}
        off |= {
            name: session.unavailable(commands.LAY_CONTROL[mode], now)
            for mode, name in _MODES.items()
        }
        return off | {"record": session.unrecorded(), "prepare": session.unprepared()}

    def _ask(self, now: float) -> dict[str, str]:
        """Return which controls ask before they act now, with the dialog that does."""
        state = self.state
        going = state.going or state.moving
        drives = state.control.mode is ControlMode.DRIVE
        return {
            commands.RESET: "ask-reset",
            "prepare": "ask-prepare" if state.time > 0.0 else "",
            "record": "ask-record" if state.recording(now).get("bag") and going else "",
            "mode-drive": "" if drives else "ask-drive",
            "mode-watch": "ask-watch" if drives and going else "",
            "mode-off": "ask-off" if drives and going else "",
        }

    def _hidden(self, now: float, off: dict[str, str]) -> dict[str, bool]:
        state = self.state
        control = state.control.known
        return {
            "recording": not state.recording(now).get("bag"),
            "control-card": not control,
            "arm-card": not self.arm.file,
            "layers": not state.control.layer_turns,
            "helix-card": control or not len(state.lay),
            "runs-card": self.runs.folder is None,
            "recipe-row": self.runs.folder is None or bool(state.player),
            "playback": state.playback is None,
            "others-card": not state.others,
            "condition-fields": not self.session.choosable(),
            "lay-limit": not control,
            "no-picture": bool(state.picture),
            # What plays a recording has nothing that could be switched.
            **{name: bool(off[name]) for name in _MODES.values()},
        }

    def _why_off(self, now: float) -> str:
        """Return why nothing can be started now, beside Start; empty when it can."""
        reason = self.session.unavailable(commands.START, now)
        if self.state.player:
            return f"Commands are off: {reason}"
        return f"Start is off: {reason}" if reason and not self.state.going else ""


def _picture_size(state: ViewState) -> tuple[int, int]:
    return _PICTURE if state.camera is None else state.camera.size
