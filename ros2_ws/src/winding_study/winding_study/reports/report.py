"""The run report: one HTML file with everything in it, readable offline and on paper."""

from __future__ import annotations

from pathlib import Path
from statistics import fmean

from winding_core.units import MEGAPASCAL, MILLIMETRE
from winding_study.documents.page import MISSING, PAGE, Tile, fixed, render_page
from winding_study.reports.lay_pictures import lay_picture, marker_picture
from winding_study.reports.lay_section import lay_section
from winding_study.reports.length_pictures import lengths_picture
from winding_study.reports.machine_pictures import speeds_picture, tension_picture
from winding_study.reports.trace_pictures import trace_picture
from winding_study.runs.run_record import RunRecord

_TEMPLATE = "report.html.j2"


def write_report(record: RunRecord, directory: Path) -> Path:
    """Write the report of a run and return the path of its page; missing folders are made."""
    directory.mkdir(parents=True, exist_ok=True)
    page = directory / PAGE
    page.write_text(render_report(record), encoding="utf-8")
    return page


def render_report(record: RunRecord) -> str:
    """Return the report of a run as one HTML text that loads nothing from anywhere."""
    return render_page(
        _TEMPLATE,
        title=_title(record),
        conditions=_conditions(record),
        tiles=_tiles(record),
        rows=[_row_texts(record, index) for index in range(len(record.rows))],
        means=_means(record),
        pictures=[
            lengths_picture(record),
            lay_picture(record),
            marker_picture(record),
            speeds_picture(record),
            tension_picture(record),
            *([] if record.trace is None else [trace_picture(record.trace)]),
        ],
        lay=None if record.lay is None else lay_section(record.lay),
        ended=record.ended,
        facts=record.facts,
        notes=record.notes,
    )


def _title(record: RunRecord) -> str:
    return f"Case {record.case.number}" if record.case.number else "Own condition"


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
        Tile(label="Simulated", value=_with_unit(record.sim_s, "s", 1)),
        Tile(label="Wall time", value=_with_unit(record.wall_s, "s", 1), remark=pace),
        _counted("Camera frames", record.frames, record.frames_lost),
        _counted("Encoder samples", record.joint_states, record.joint_states_lost),
        Tile(label="Mean error, predicted", value=_mean_error(record, "error_fem_pct")),
        Tile(label="Mean error, corrected", value=_mean_error(record, "error_corrected_pct")),
    ]


def _counted(label: str, count: int | None, lost: int | None) -> Tile:
    remark = "" if lost is None else "none lost" if lost == 0 else f"{lost:,} lost"
    return Tile(label=label, value=MISSING if count is None else f"{count:,}", remark=remark)


def _mean_error(record: RunRecord, name: str) -> str:
    errors = [getattr(row, name) for row in record.rows if getattr(row, name) is not None]
    return f"{fmean(errors):.2f} %" if errors else MISSING


def _row_texts(record: RunRecord, index: int) -> list[str]:
    row = record.rows[index]
    return [
        f"P{row.id}",
        _millimetres(row.original),
        _millimetres(row.s_fem),
        _millimetres(row.s_tracked),
        fixed(row.h, 4),
        _millimetres(row.s_corrected),
        _interval(row.s_low, row.s_high),
        _millimetres(row.s_published),
        fixed(row.error_fem_pct, 2),
        fixed(row.error_corrected_pct, 2),
    ]


def _means(record: RunRecord) -> list[str]:
    return [
        _mean_error(record, name).removesuffix(" %")
        for name in ("error_fem_pct", "error_corrected_pct")
    ]


def _interval(low: float | None, high: float | None) -> str:
    if low is None or high is None:
        return MISSING
    return f"{low / MILLIMETRE:.0f} to {high / MILLIMETRE:.0f}"


def _millimetres(value: float | None) -> str:
    return MISSING if value is None else fixed(value / MILLIMETRE, 2)


def _with_unit(value: float | None, unit: str, digits: int) -> str:
    return MISSING if value is None else f"{value:.{digits}f} {unit}"
