"""The band that is read from three metres away: state, condition, progress, verdict."""

from __future__ import annotations

import math
from dataclasses import dataclass

from winding_core.cable.wound_label import WoundLabel
from winding_core.lay.errors import LayVerdict, judge, turn_errors
from winding_core.run_options import OperatorLimits
from winding_core.status import MACHINE_STATUS, STATUS, RunPhase
from winding_dashboard.page.numbers import DASH, seconds
from winding_dashboard.state.view_state import ViewState

# Phase of the machine -> the word on the band, and its style.
_WORDS = {
    "winding": ("WINDING", "winding"),
    "stopping": ("STOPPING", "winding"),
    "finished": ("FINISHED", "stopped"),
    "emergency stop": ("E-STOP", "alarm"),
    "protective stop": ("P-STOP", "alarm"),
}


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One part of the band."""

    word: str  # In large letters
    remark: str  # Beneath it
    style: str = ""  # Of the word; empty for none


def state_cell(state: ViewState, now: float, preparing: str = "") -> Cell:
    """Return what the machine does, at wall time now [s].

    Args:
        state: What is known of it.
        now: Wall time [s].
        preparing: What the nodes are taken through; empty when they are left alone.
    """
    if state.player:
        recorded = ", ".join(filter(None, (state.phase, _speed(state))))
        silent = "" if state.heard(now) else f"{state.player} is silent; "
        return Cell(word="PLAYBACK", remark=f"{silent}recorded: {recorded}", style="playback")
    if danger := state.health.message(MACHINE_STATUS):
        return Cell(word="NOT STOPPED", remark=danger, style="alarm")
    if state.run_phase is RunPhase.FAILED:
        remark = state.health.message(STATUS) or "the session cannot go on"
        return Cell(word="FAILED", remark=remark, style="alarm")
    if not state.heard(now):
        return Cell(word="NO DATA", remark="nothing heard of the machine", style="alarm")
    if preparing:
        return Cell(word="PREPARING", remark=preparing, style="stopped")
    down = state.health.down(now)
    word, style = _WORDS.get("" if state.machine in down else state.phase, ("", ""))
    if down and style != "alarm":
        turns = "; the cylinder turns" if state.moving and not state.clock_stands else ""
        return Cell(word="NODES DOWN", remark="; ".join(down.values()) + turns, style="alarm")
    if word:
        remark = state.reason or (_speed(state) if state.going else f"at {state.run_time:.1f} s")
        return Cell(word=word, remark=remark, style=style)
    if state.moving and not state.clock_stands:
        return Cell(word="WINDING", remark=_speed(state), style="winding")
    if state.moving and not state.phase:
        remark = f"the encoders are silent; last heard {_speed(state)}"
        return Cell(word="NO DATA", remark=remark, style="alarm")
    if state.run_phase is RunPhase.OVER:
        return Cell(word="STOPPED", remark="the run is over", style="stopped")
    if state.run_time > 0.0:
        return Cell(word="STOPPED", remark=f"stopped at {state.run_time:.1f} s", style="stopped")
    return Cell(word="READY", remark=state.phase or "standing", style="ready")


def condition_cell(label: WoundLabel | None) -> Cell:
    """Return what is wound."""
    if label is None:
        return Cell(word=DASH, remark="no condition is set up")
    word = f"CASE {label.case}" if label.case else "OWN"
    return Cell(word=word, remark=label.sentence)


def progress_cell(state: ViewState, label: WoundLabel | None) -> Cell:
    """Return how far the run has come, on the machine's clock."""
    passed = state.run_time
    if label is None or not math.isfinite(passed):
        return Cell(word=DASH, remark="not begun")
    left = max(label.duration - passed, 0.0)
    return Cell(
        word=f"{100.0 * min(passed / label.duration, 1.0):.0f} %",
        remark=f"{min(passed, label.duration):.1f} of {label.duration:g} s machine time"
        + (f", {seconds(left)} left" if state.going else ""),
    )


def verdict_cell(state: ViewState, limits: OperatorLimits) -> Cell:
    """Return how the present run came out; what is measured so far before that is reported.

    A limit that is passed cannot be kept any more: only that is shown before the end.
    """
    verdict = state.verdict
    if verdict is not None:
        return Cell(word=verdict.word.upper(), remark=verdict.sentence, style=verdict.style)
    over, remarks = False, []
    lay = lay_verdict(state, limits.lay_tolerance)
    if lay is not None and lay.worst is not None:
        over = abs(lay.worst.largest) > limits.lay_tolerance
        off, limit = (1000.0 * value for value in (lay.worst.largest, limits.lay_tolerance))
        turn = lay.worst.number
        remarks.append(f"lay {off:+.2f} mm off at most, limit {limit:g} mm, turn {turn}")
    rows = state.marker_rows()
    judged = [row for row in rows if math.isfinite(row.corrected) and math.isfinite(row.measured)]
    if judged:
        worst = max(judged, key=lambda row: abs(row.difference))
        error = 100.0 * abs(worst.difference)
        over = over or error > limits.error_limit_pct
        remarks.append(
            f"{len(judged)} of {len(rows)} markers, largest error {error:.2f} %, "
            f"limit {limits.error_limit_pct:g} %, P{worst.id}"
        )
    if not remarks:
        return Cell(word=DASH, remark="nothing measured yet")
    return Cell(
        word="OVER LIMIT" if over else DASH,
        remark=f"so far: {'; '.join(remarks)}",
        style="not-good" if over else "",
    )


def lay_verdict(state: ViewState, tolerance: float) -> LayVerdict | None:
    """Return how the measured turns keep a tolerance [m]; None where no lay is wanted."""
    if not state.control.known:
        return None
    wanted = state.control.wanted
    return judge(turn_errors(state.lay, wanted), tolerance, wanted.end)


def _speed(state: ViewState) -> str:
    return "" if state.axes is None else f"{state.axes.angular_speed:.2f} rad/s"
