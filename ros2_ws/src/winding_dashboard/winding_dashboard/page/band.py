"""The band that is read from three metres away: state, condition, progress, verdict."""

from __future__ import annotations

import math
from dataclasses import dataclass

from winding_core.cable.wound_label import WoundLabel
from winding_core.error_verdict import ErrorVerdict, judge_lengths
from winding_core.lay.errors import LayVerdict, judge, turn_errors
from winding_core.run_options import OperatorLimits
from winding_core.status import RunPhase
from winding_dashboard.page.numbers import DASH, seconds
from winding_dashboard.state.marker_rows import MarkerRow
from winding_dashboard.state.view_state import ViewState

# Phase of the machine -> the word on the band, and its style.
_WORDS = {
    "winding": ("WINDING", "winding"),
    "stopping": ("STOPPING", "winding"),
    "finished": ("FINISHED", "finished"),
    "emergency stop": ("E-STOP", "alarm"),
    "protective stop": ("P-STOP", "alarm"),
}


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One part of the band."""

    word: str  # In large letters
    remark: str  # Beneath it
    style: str = ""  # Of the word; empty for none


def state_cell(state: ViewState, now: float) -> Cell:
    """Return what the machine does, at wall time now [s]."""
    if not state.heard(now):
        return Cell(word="NO DATA", remark="nothing heard of the machine", style="alarm")
    if state.run_phase is RunPhase.FAILED:
        return Cell(word="FAILED", remark="the session cannot go on", style="alarm")
    phase, reason = state.phase, state.reason
    if phase in _WORDS:
        word, style = _WORDS[phase]
        remark = reason or (_speed(state) if state.going else f"at {state.run_time:.1f} s")
        return Cell(word=word, remark=remark, style=style)
    if state.moving:
        return Cell(word="WINDING", remark=_speed(state), style="winding")
    if state.run_phase is RunPhase.OVER:
        return Cell(word="STOPPED", remark="the run is over", style="stopped")
    if state.run_time > 0.0:
        return Cell(word="STOPPED", remark=f"stopped at {state.run_time:.1f} s", style="stopped")
    return Cell(word="READY", remark=phase or "standing", style="ready")


def condition_cell(label: WoundLabel | None) -> Cell:
    """Return what is wound."""
    if label is None:
        return Cell(word=DASH, remark="no condition heard yet")
    word = f"CASE {label.case}" if label.case else "OWN"
    return Cell(word=word, remark=label.sentence)


def progress_cell(state: ViewState, label: WoundLabel | None) -> Cell:
    """Return how far the run has come, on the machine's clock."""
    passed = state.run_time
    if label is None or not math.isfinite(passed):
        return Cell(word=DASH, remark="not begun")
    if state.phase == "finished" or passed >= label.duration:
        return Cell(word="100 %", remark=f"all of {label.duration:g} s")
    return Cell(
        word=f"{100.0 * passed / label.duration:.0f} %",
        remark=f"{passed:.1f} of {label.duration:g} s, {seconds(label.duration - passed)} left",
    )


def verdict_cell(state: ViewState, limits: OperatorLimits) -> Cell:
    """Return whether the lay is good so far: every limit that there is something to hold to."""
    lengths = length_verdict(state.marker_rows(), limits.error_limit_pct)
    remarks, goods = [], []
    lay = lay_verdict(state, limits.lay_tolerance)
    if lay is not None and lay.worst is not None:
        goods.append(abs(lay.worst.largest) <= limits.lay_tolerance)
        off, limit = (1000.0 * value for value in (lay.worst.largest, limits.lay_tolerance))
        turn = lay.worst.number
        remarks.append(f"lay {off:+.2f} mm off at most, limit {limit:g} mm, turn {turn}")
    worst = lengths.worst
    if worst is not None and worst.corrected is not None:
        goods.append(bool(lengths.good))
        remarks.append(
            f"largest error {worst.corrected:.2f} %, limit {limits.error_limit_pct:g} %, "
            f"{worst.name}"
        )
    if not goods:
        return Cell(word=DASH, remark="nothing measured to judge by")
    good = all(goods)
    return Cell(
        word="GOOD" if good else "NOT GOOD",
        remark="; ".join(remarks),
        style="good" if good else "not-good",
    )


def lay_verdict(state: ViewState, tolerance: float) -> LayVerdict | None:
    """Return how the measured turns keep a tolerance [m]; None where no lay is wanted."""
    if not state.control.known:
        return None
    wanted = state.control.wanted
    return judge(turn_errors(state.lay, wanted), tolerance, wanted.end)


@dataclass(frozen=True, kw_only=True)
class _Lengths:
    """Lengths of a row as a verdict takes them; the camera measures."""

    id: int
    s_fem: float | None
    s_corrected: float | None
    s_tracked: float | None
    s_held_out: float | None = None
    s_published: float | None = None


def length_verdict(rows: list[MarkerRow], limit_pct: float) -> ErrorVerdict:
    """Return how the corrected lengths keep a limit [%], against what the camera measured."""
    return judge_lengths(
        [
            _Lengths(
                id=row.id,
                s_fem=_known(row.predicted),
                s_corrected=_known(row.corrected),
                s_tracked=_known(row.measured),
            )
            for row in rows
        ],
        limit_pct,
        published=False,
    )


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _speed(state: ViewState) -> str:
    return "" if state.axes is None else f"{state.axes.angular_speed:.2f} rad/s"
