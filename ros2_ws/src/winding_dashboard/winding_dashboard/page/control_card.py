"""The card of the lay's controller: mode, basis of its commands, estimates."""

from __future__ import annotations

import math
from collections.abc import Mapping

from winding_core.lay.records import ControlBasis, ControlMode
from winding_dashboard.page.cell import DASH, millimetres
from winding_dashboard.state.control_state import ControlState

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
