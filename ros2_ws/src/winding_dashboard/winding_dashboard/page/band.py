"""The band that is read from three metres away: state, condition, progress, outcome."""

import math
from collections.abc import Iterable

from winding_core.cable.wound_label import WoundLabel
from winding_core.run_outcome import Verdict
from winding_core.status import MACHINE_STATUS, STATUS, RunPhase
from winding_dashboard.page.cell import DASH, Cell, seconds
from winding_dashboard.state.view_state import ViewState

# Phase of the machine -> the word on the band, and its style.
_WORDS = {
    "winding": ("WINDING", "winding"),
    "stopping": ("STOPPING", "winding"),
    "finished": ("FINISHED", "stopped"),
    "emergency stop": ("E-STOP", "alarm"),
    "protective stop": ("P-STOP", "alarm"),
}
_STYLES = {verdict.value: verdict.style for verdict in Verdict}


def band(state: ViewState, now: float, preparing: str) -> list[Cell]:
    """Return the band at wall time now [s].

    Args:
        state: What is known of machine and run.
        now: Wall time [s].
        preparing: What the nodes are taken through; empty when they are left alone.
    """
    word, remark, style = _state(state, now, preparing)
    return [
        Cell(name="state", word=word, remark=remark, style=style),
        _condition(state.label),
        _progress(state, state.label),
        outcome_cell(state.outcome["verdict"], state.outcome.get("sentences", "").splitlines())
        if "verdict" in state.outcome
        else Cell(name="verdict", word=DASH, remark="no run is over"),
    ]


def outcome_cell(verdict: str, sentences: Iterable[str]) -> Cell:
    """Return how a run came out, as its record prints it; the page judges no run itself."""
    style = _STYLES.get(verdict, "open")
    return Cell(name="verdict", word=verdict.upper(), remark="; ".join(sentences), style=style)


def _state(state: ViewState, now: float, preparing: str) -> tuple[str, str, str]:
    """Return what the machine does in a word and a sentence, and the word's style."""
    if state.player:
        recorded = ", ".join(filter(None, (state.phase, _speed(state))))
        silent = "" if state.heard(now) else f"{state.player} is silent; "
        return "PLAYBACK", f"{silent}recorded: {recorded}", "playback"
    if danger := state.health.message(MACHINE_STATUS):
        return "NOT STOPPED", danger, "alarm"
    if state.run_phase is RunPhase.FAILED:
        return "FAILED", state.health.message(STATUS) or "the session cannot go on", "alarm"
    if not state.heard(now):
        return "NO DATA", "no data from the machine", "alarm"
    if preparing:
        return "PREPARING", preparing, "stopped"
    down = state.health.down(now)
    word, style = _WORDS.get("" if state.machine in down else state.phase, ("", ""))
    turns = state.moving and not state.clock_stands
    if down and style != "alarm":
        return "NODES DOWN", "; ".join([*down.values(), *["the cylinder turns"] * turns]), "alarm"
    if word:
        remark = state.reason or (_speed(state) if state.going else f"at {state.run_time:.1f} s")
        return word, remark, style
    if turns:
        return "WINDING", _speed(state), "winding"
    if state.moving and not state.phase:
        return "NO DATA", f"the encoders are silent; last reading {_speed(state)}", "alarm"
    if state.run_phase is RunPhase.OVER:
        return "STOPPED", "the run is over", "stopped"
    if state.run_time > 0.0:
        return "STOPPED", f"stopped at {state.run_time:.1f} s", "stopped"
    return "READY", state.phase or "standing", "ready"


def _condition(label: WoundLabel | None) -> Cell:
    if label is None:
        return Cell(name="condition", word=DASH, remark="no condition is set up")
    word = f"CASE {label.case}" if label.case else "OWN"
    return Cell(name="condition", word=word, remark=label.sentence)


def _progress(state: ViewState, label: WoundLabel | None) -> Cell:
    """Return how far the run has come, on the machine's clock."""
    passed = state.run_time
    if label is None or not math.isfinite(passed):
        return Cell(name="progress", word=DASH, remark="not begun")
    left = f", {seconds(max(label.duration - passed, 0.0))} left" if state.going else ""
    passed = min(passed, label.duration)
    return Cell(
        name="progress",
        word=f"{100.0 * passed / label.duration:.0f} %",
        remark=f"{passed:.1f} of {label.duration:g} s machine time{left}",
    )


def _speed(state: ViewState) -> str:
    return "" if state.axes is None else f"{state.axes.angular_speed:.2f} rad/s"
