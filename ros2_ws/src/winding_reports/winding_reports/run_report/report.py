"""The run report: one HTML file with everything in it, readable offline and on paper."""

from pathlib import Path
from statistics import fmean
from typing import Any

from winding_core.error_verdict import CAMERA, ErrorVerdict, MarkerError
from winding_core.run_outcome import RunOutcome
from winding_core.units import MEGAPASCAL, MILLIMETRE
from winding_reports.documents.page import MISSING, PAGE, Tile, fixed, render_page
from winding_reports.records.identity import condition_texts
from winding_reports.records.run_record import MarkerRow, RunRecord
from winding_reports.run_report.cable_pictures import cable_picture
from winding_reports.run_report.lay_section import lay_section
from winding_reports.run_report.machine_pictures import (
    arm_picture,
    speeds_picture,
    tension_picture,
    trace_picture,
)
from winding_reports.run_report.marker_pictures import lay_picture, lengths_picture, marker_picture

_TEMPLATE = "report.html.j2"
_FACTS = "How the run was made"
_ERRORS = ("predicted", "corrected", "held_out")


def write_report(record: RunRecord, directory: Path) -> Path:
    """Write the report of a run and return the path of its page; missing folders are made."""
    directory.mkdir(parents=True, exist_ok=True)
    page = directory / PAGE
    page.write_text(render_report(record), encoding="utf-8")
    return page


def render_report(record: RunRecord) -> str:
    """Return the report of a run as one HTML text that loads nothing from anywhere."""
    verdict = record.verdict
    held_out = verdict.worst_held_out is not None
    identity, condition = record.identity.texts(), condition_texts(record.identity.condition)
    pictures = [
        lengths_picture(record),
        *([] if record.cable is None else [cable_picture(record.cable)]),
        lay_picture(record),
        marker_picture(record),
        speeds_picture(record),
        tension_picture(record),
        *([] if record.arm is None else [arm_picture(record.arm, record.case.cylinder_radius)]),
        *([] if record.trace is None else [trace_picture(record.trace)]),
    ]
    lay = None if record.lay is None else lay_section(record.lay)
    contents = [
        "Every marker",
        *(["This run"] if identity else []),
        *(["Condition"] if condition else []),
        *([] if lay is None else ["Lay", *(picture.title for picture in lay.pictures)]),
        *(picture.title for picture in pictures),
        *(["What these numbers are worth"] if record.notes else []),
        *([_FACTS] if record.facts else []),
    ]
    return render_page(
        _TEMPLATE,
        title=f"Case {record.case.number}" if record.case.number else "Own condition",
        verdict=_verdict(record.outcome),
        contents=contents,
        identity=identity,
        condition=condition,
        error_names=["Predicted", "Corrected, in-sample", "Corrected, held out"]
        if held_out
        else ["Predicted", "Corrected"],
        against=verdict.against,
        measured="tracked" if verdict.against == CAMERA else "published",
        held_out=held_out,
        element=record.element,
        facts_title=_FACTS,
        conditions=_conditions(record),
        tiles=_tiles(record),
        rows=[
            _row_texts(row, error, held_out=held_out, rod=record.element != "rod")
            for row, error in zip(record.rows, verdict.errors, strict=True)
        ],
        means=[_mean(verdict, name) for name in _ERRORS[: 3 if held_out else 2]],
        pictures=pictures,
        lay=lay,
        facts=record.facts,
        notes=record.notes,
    )


def _conditions(record: RunRecord) -> dict[str, str]:
    case, drive = record.case, record.drive
    return {
        "Cylinder": f"Ø {case.cylinder_diameter / MILLIMETRE:g} mm",
        "Cable": f"Ø {case.cable_diameter / MILLIMETRE:g} mm",
        "Dead weight": f"{case.weight:.3f} N ({case.nominal_stress / MEGAPASCAL:.4g} MPa)",
        "Marker spacing": f"{case.marker_spacing / MILLIMETRE:g} mm",
        "Material": f"E {case.material.young / MEGAPASCAL:g} MPa, ν {case.material.poisson:g}, "
        f"{case.material.density:g} kg/m³",
        "Drive": f"{drive.angular_speed:g} rad/s and {drive.feed_speed / MILLIMETRE:g} mm/s "
        f"after {drive.ramp_time:g} s",
    }


def _tiles(record: RunRecord) -> list[Tile]:
    pace = ""
    if record.sim_s and record.wall_s:
        pace = f"{record.sim_s / record.wall_s:.2g} × real time"
    return [
        Tile(label="Simulated", value=_with_unit(record.sim_s, "s")),
        Tile(label="Wall time", value=_with_unit(record.wall_s, "s"), remark=pace),
        _counted("Camera frames", record.frames, record.frames_lost),
        _counted("Encoder samples", record.joint_states, record.joint_states_lost),
        *_mean_tiles(record.verdict),
    ]


def _counted(label: str, count: int | None, lost: int | None) -> Tile:
    remark = "" if lost is None else "none lost" if lost == 0 else f"{lost:,} lost"
    return Tile(label=label, value=MISSING if count is None else f"{count:,}", remark=remark)


def _mean_tiles(verdict: ErrorVerdict) -> list[Tile]:
    before = f"predicted {_mean(verdict, 'predicted')} %"
    names = {"in-sample": "corrected", "held out": "held_out"}
    if verdict.worst_held_out is None:
        names = {"corrected": "corrected"}
    tiles = []
    for name, of in names.items():
        mean = _mean(verdict, of)
        value = mean if mean == MISSING else f"{mean} %"
        tiles.append(Tile(label=f"Mean error, {name}", value=value, remark=before))
    return tiles


def _mean(verdict: ErrorVerdict, name: str) -> str:
    errors = [value for item in verdict.errors if (value := getattr(item, name)) is not None]
    return fixed(fmean(errors) if errors else None, 2)


def _verdict(outcome: RunOutcome) -> dict[str, Any]:
    """Return the outcome with the word that stands out, and the style of its lines."""
    word = outcome.verdict.value
    return {
        "word": word[0].upper() + word[1:],
        "style": outcome.verdict.style,
        "sentences": outcome.sentences,
    }


def _row_texts(row: MarkerRow, error: MarkerError, *, held_out: bool, rod: bool) -> list[str]:
    return [
        f"P{row.id}",
        _millimetres(row.original),
        _millimetres(row.s_fem),
        *([_millimetres(row.s_rod)] if rod else []),
        _millimetres(row.s_tracked),
        fixed(row.h, 4),
        _millimetres(row.s_corrected),
        _interval(row.s_low, row.s_high),
        _millimetres(row.s_published),
        *(fixed(getattr(error, name), 2) for name in _ERRORS[: 3 if held_out else 2]),
    ]


def _interval(low: float | None, high: float | None) -> str:
    if low is None or high is None:
        return MISSING
    return f"{low / MILLIMETRE:.0f} to {high / MILLIMETRE:.0f}"


def _millimetres(value: float | None) -> str:
    return fixed(value, 2, MILLIMETRE)


def _with_unit(value: float | None, unit: str) -> str:
    return MISSING if value is None else f"{value:.1f} {unit}"
