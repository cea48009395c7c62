"""Everything that the page shows at one moment, complete, with one sequence number.

A browser shows the newest snapshot that it has and nothing else, so what it shows belongs to one
moment however long it was away (decision 18). Single texts are in `texts`; everything else is a
part of the page that is drawn anew when it has changed.
"""

from __future__ import annotations

import base64
import math
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from winding_core.cable.material_report import MaterialReport
from winding_core.lay.errors import turn_errors
from winding_core.lay.records import ControlBasis, ControlMode
from winding_core.machine.readings import Quantity
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
from winding_dashboard.page.cell import DASH, Cell, millimetres, number
from winding_dashboard.page.run_list import RunList
from winding_dashboard.page.session import OperatorSession
from winding_dashboard.state.control_state import ControlState
from winding_dashboard.state.health import RECORDER, recording_sentence
from winding_dashboard.state.view_state import ViewState

_MEGA = 1.0e6
_SHOWN_VOTES = 3  # Votes that are shown; the others are below
# The clock of a simulated machine ends with its run, at full speed: nothing turns any more.
_OVER, _STANDS = ("finished", "emergency stop"), "stands; the machine's clock has ended"


def material_sentence(material: MaterialReport | None) -> str:
    """Return the identified modulus as a sentence."""
    if material is None:
        return "Effective modulus: no marker is measured yet"
    if material.refusal:
        return f"Effective modulus: {material.refusal}"
    markers = ", ".join(f"P{number}" for number in material.markers)
    return (
        f"Effective modulus {material.young / _MEGA:.3f} ± "
        f"{material.half_width_90 / _MEGA:.3f} MPa (nine times in ten), "
        f"{material.law.replace('_', ' ')}, from {markers}; "
        f"the model {'goes on with it' if material.taken_up else 'keeps its own'}"
    )


def figures(state: ViewState) -> list[Cell]:
    """Return the newest readings."""
    axes, wanted = state.axes, state.setpoints
    over = state.phase in _OVER and state.clock_stands

    def speed(name: str) -> tuple[float, float]:
        measured = 0.0 if over else getattr(axes, name, math.nan)
        return measured, getattr(wanted, name, math.nan)

    turning, set_turning = speed("angular_speed")
    feed, set_feed = speed("feed_speed")
    angle = axes.cylinder_angle if axes is not None else math.nan
    carriage = axes.carriage_position if axes is not None else math.nan
    best = next(iter(state.votes), None)
    return [
        Cell(
            name="Cylinder, rad/s",
            word=number(turning, 3),
            remark=_STANDS if over else f"set {number(set_turning, 3)}",
        ),
        Cell(
            name="Carriage, mm/s",
            word=millimetres(feed, 2),
            remark=_STANDS if over else f"set {millimetres(set_feed, 2)}",
        ),
        *(_measured(state, quantity) for quantity in state.measured),
        Cell(
            name="Wound, turns", word=number(angle / math.tau, 2), remark=f"{number(angle, 2)} rad"
        ),
        Cell(name="Carriage at, mm", word=millimetres(carriage, 1), remark="guide"),
        Cell(name="Resembles case", word=DASH if best is None else str(best), remark=_votes(state)),
    ]


def _measured(state: ViewState, quantity: Quantity) -> Cell:
    old = state.old(quantity.name)
    source = quantity.sensor.replace("_", " ")
    return Cell(
        name=f"{quantity.name.capitalize()}, {quantity.unit}",
        word=number(state.measured[quantity], quantity.digits),
        remark=f"{source}, {old:.0f} s of machine time old" if old else source,
        style="old" if old else "",
    )


def _votes(state: ViewState) -> str:
    if not state.votes:
        return "nothing measured"
    shown = list(state.votes.items())[:_SHOWN_VOTES]
    return ", ".join(
        f"{share:.0%}" if index == 0 else f"{case}: {share:.0%}"
        for index, (case, share) in enumerate(shown)
    )


_BASES = {
    ControlBasis.MEASURED: "the measured lay is fed back",
    ControlBasis.MODEL: "TRACKER LOST: no lay has been measured for more than 1.5 turns; the guide "
    "is fed forward by the model",
    ControlBasis.RAMP: "SOLVER LOST: the guide follows the plain ramp of the drive programme",
    ControlBasis.LATE: "COMMANDS LATE: the guide follows the plain ramp of the drive programme",
}
MODES = {
    None: DASH,
    ControlMode.OFF: "Off: commands nothing",
    ControlMode.WATCH: "Watch: shows what it would command",
    ControlMode.DRIVE: "Drive: commands the machine",
}


def basis_words(control: ControlState, now: float) -> tuple[str, bool]:
    """Return what commands rest on, and whether that is a fall-back, at the machine's time [s]."""
    if control.silent(now):
        return f"silent for {now - control.time:.0f} s of the machine's time", True
    basis = control.basis
    if basis is None:
        return "waits for the machine to move", False
    held = control.newest is not None and bool(control.newest["limited"])
    text = _BASES[basis] + ("; a bound of the carriage holds the guide back" if held else "")
    return text, basis is not ControlBasis.MEASURED


def beliefs(control: ControlState) -> dict[str, str]:
    """Return estimates with one standard deviation and commands, by their names."""
    newest = control.newest
    if newest is None:
        return dict.fromkeys(
            ("Lands at", "Wanted there", "Free length", "Share of the pull", "Guide", "Pull"), DASH
        )
    would = "" if control.mode is ControlMode.DRIVE else "would be "
    return {
        "Lands at": _with_sigma(newest["z"], newest["sigma_z"], 2),
        "Wanted there": f"{millimetres(newest['wanted_z'], 2)} mm",
        "Free length": _with_sigma(newest["free_length"], newest["sigma_free_length"], 1),
        "Share of the pull": f"{newest['load_share']:.3f} ± {newest['sigma_load_share']:.3f}",
        "Guide": f"{would}{millimetres(newest['guide'], 1)} mm",
        "Pull": f"{would}{newest['pull']:.2f} N" if math.isfinite(newest["pull"]) else "not set",
        **_layers(control.values),
    }


def _layers(values: Mapping[str, str]) -> dict[str, str]:
    """Return where on a drum the cable lands, and what was found last; nothing without one."""
    if "layer" not in values:
        return {}
    turn, share = values["turn_of_layer"], 100.0 * float(values["measured_share_of_layer"])
    seen = f"{share:.0f} % measured" if math.isfinite(share) else "nothing measured"
    return {
        "Layer": f"{values['layer']}, turn {turn}, {seen}",
        "Found": values["newest_layer_fault"] or "no gap, climb or missing edge turn",
    }


def _with_sigma(value: float, sigma: float, digits: int) -> str:
    return f"{millimetres(value, digits)} ± {millimetres(sigma, digits)} mm"


# Nothing is drawn more often than this [s]; charts and lists change more slowly.
PERIOD = 0.15
_SLOW = 0.5
# Diagnostics come once a second: what was heard within this time is the present [s].
_PRESENT = 1.5
_REMEMBERED = 256
_MOST_NODES, _NEWEST_TURNS = 12, 6
# Element of each switch of the lay's controller.
_MODES = {mode: f"mode-{mode.name.lower()}" for mode in ControlMode}
_PICTURE = (800, 120)  # Of a camera whose picture size is not known yet [px]

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
