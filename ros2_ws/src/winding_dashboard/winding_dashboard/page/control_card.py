"""The card of the lay's controller: mode, basis of its commands, estimates, newest turns."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from winding_core.lay.errors import TurnError, turn_state
from winding_core.lay.records import ControlBasis, ControlMode
from winding_core.units import MILLIMETRE
from winding_dashboard.page.numbers import DASH, PER_METRE, number
from winding_dashboard.state.control_state import ControlState

# Newest turns in the table.
_ROWS = 6
_STYLES = {"off": "bad", "partly seen": "warn"}
_BASES = {
    ControlBasis.MEASURED: "the measured lay is fed back",
    ControlBasis.MODEL: "TRACKER LOST: no lay has been measured for more than 1.5 turns; the guide "
    "is fed forward by the model",
    ControlBasis.RAMP: "SOLVER LOST: the guide follows the plain ramp of the drive programme",
    ControlBasis.LATE: "COMMANDS LATE: the guide follows the plain ramp of the drive programme",
}
_MODES = {
    ControlMode.OFF: "Off: commands nothing",
    ControlMode.WATCH: "Watch: shows what it would command",
    ControlMode.DRIVE: "Drive: commands the machine",
}


@dataclass(frozen=True, kw_only=True)
class TurnLine:
    """One turn's row."""

    cells: tuple[str, ...]  # Number, and lengths in millimetres
    state: str  # How the turn lies, in a word or two
    style: str  # Of that


def turn_lines(turns: Sequence[TurnError], tolerance: float) -> list[TurnLine]:
    """Return a row for each of the newest turns, held against a tolerance [m]."""
    return [_line(turn, tolerance) for turn in turns[-_ROWS:]]


def _line(turn: TurnError, tolerance: float) -> TurnLine:
    state = turn_state(turn, tolerance)
    return TurnLine(
        cells=(
            str(turn.number),
            number(turn.wanted_z, 2, PER_METRE),
            number(turn.measured_z, 2, PER_METRE),
            number(turn.mean, 2, PER_METRE, sign=True),
            number(turn.largest, 2, PER_METRE, sign=True),
        ),
        state=state,
        style=_STYLES.get(state, "quiet"),
    )


def mode_words(mode: ControlMode | None) -> str:
    """Return what a mode means; a dash before it is known."""
    return DASH if mode is None else _MODES[mode]


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
            ("Lands at", "Wanted there", "Free length", "Share of the pull", "Guide", "Pull"),
            DASH,
        )
    would = "" if control.mode is ControlMode.DRIVE else "would be "
    return {
        "Lands at": _with_sigma(newest["z"], newest["sigma_z"], 2),
        "Wanted there": _millimetres(newest["wanted_z"], 2),
        "Free length": _with_sigma(newest["free_length"], newest["sigma_free_length"], 1),
        "Share of the pull": f"{newest['load_share']:.3f} ± {newest['sigma_load_share']:.3f}",
        "Guide": f"{would}{_millimetres(newest['guide'], 1)}",
        "Pull": f"{would}{newest['pull']:.2f} N" if math.isfinite(newest["pull"]) else "not set",
    }


def _millimetres(value: float, digits: int) -> str:
    return f"{value / MILLIMETRE:.{digits}f} mm"


def _with_sigma(value: float, sigma: float, digits: int) -> str:
    return f"{value / MILLIMETRE:.{digits}f} ± {sigma / MILLIMETRE:.{digits}f} mm"
