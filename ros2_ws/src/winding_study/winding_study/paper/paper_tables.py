"""Tables 2 to 8 of the paper with this project's numbers beside the printed ones, cell by cell."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

from winding_core.cable.cases import (
    Lay,
    PublishedMarker,
    length_error_pct,
    paper_case,
    published_markers,
    published_weights,
)
from winding_core.units import MEGAPASCAL, MILLIMETRE
from winding_reports.documents.data_table import Column, DataTable, Value
from winding_study.paper.case_result import CaseResult

Row = Mapping[str, Value]
# h by (case, marker).
Factors = Mapping[tuple[int, int], float]

# The published simulation column is 'paper', the experiment 'experiment'.
PAPER = "paper"
EXPERIMENT = "experiment"


def paper_tables(
    results: Iterable[CaseResult], cases: Iterable[int], factors: Mapping[str, Factors], who: str
) -> tuple[DataTable, ...]:
    """Return Tables 2 to 8.

    Args:
        results: What this project wound; nothing when the paper's simulation is the base.
        cases: Rows of Table 1 that are asked for.
        factors: h by name of the model whose corrected error Table 8 shows beside the paper's.
        who: Name of this project's columns, such as ``rod``.
    """
    wound = {result.case: result.lays for result in results}
    asked = set(cases)
    rows = [row for row in published_markers() if row.case in asked]
    ours = {(row.case, row.marker): wound.get(row.case, {}).get(row.marker) for row in rows}
    base = ours if wound else {(row.case, row.marker): row.simulation for row in rows}
    shown = who if wound else None
    cables = {2: 2, 3: 4, 4: 6}
    cylinders = {5: 30, 6: 60}
    return (
        *(_lay_table(number, mm, rows, ours, shown) for number, mm in cables.items()),
        *(_length_table(number, mm, rows, ours, shown) for number, mm in cylinders.items()),
        _error_table(rows, ours, shown),
        _updated_table(rows, base, factors, shown or "paper's simulation"),
    )


def _lay_table(
    number: int,
    cable_mm: int,
    rows: Sequence[PublishedMarker],
    ours: Mapping[tuple[int, int], Lay | None],
    who: str | None,
) -> DataTable:
    def values(row: PublishedMarker) -> Row:
        case = paper_case(row.case)
        sides = _sides(row, ours, who)
        content: dict[str, Value] = {
            "cylinder, mm": case.cylinder_diameter / MILLIMETRE,
            "tension, MPa": case.nominal_stress / MEGAPASCAL,
        }
        content |= _places(sides, "theta", "rad", 1.0) | _places(sides, "z", "mm", MILLIMETRE)
        return content | _gaps(sides, "theta", "rad", 1.0) | _gaps(sides, "z", "mm", MILLIMETRE)

    return _table(
        number,
        f"wound angles and axial positions, cable of {cable_mm} mm",
        [row for row in rows if _is(paper_case(row.case).cable_diameter, cable_mm)],
        values,
        digits={"cylinder, mm": 0, "tension, MPa": 4},
        note="Differences are taken against the experiment, where it has a number. The paper "
        "heads its blocks 0.6245 and 1.249 MPa; the tension here is Table 1's.",
    )


def _length_table(
    number: int,
    cylinder_mm: int,
    rows: Sequence[PublishedMarker],
    ours: Mapping[tuple[int, int], Lay | None],
    who: str | None,
) -> DataTable:
    def values(row: PublishedMarker) -> Row:
        sides = _sides(row, ours, who)
        content: dict[str, Value] = {"undeformed, mm": row.original_length / MILLIMETRE}
        content |= _places(sides, "S", "mm", MILLIMETRE)
        return content | _gaps(sides, "S", "mm", MILLIMETRE)

    return _table(
        number,
        f"curve lengths from P0, cylinder of {cylinder_mm} mm",
        [row for row in rows if _is(paper_case(row.case).cylinder_diameter, cylinder_mm)],
        values,
        digits={"undeformed, mm": 0},
    )


def _error_table(
    rows: Sequence[PublishedMarker], ours: Mapping[tuple[int, int], Lay | None], who: str | None
) -> DataTable:
    def values(row: PublishedMarker) -> Row:
        content: dict[str, Value] = {"paper, as printed": row.error_pct}
        for name, lay in _sides(row, ours, who).items():
            if name != EXPERIMENT:
                label = "paper, from its lengths" if name == PAPER else name
                content[label] = _corrected(row, lay, 1.0)
        return content

    return _table(
        7,
        "error of the predicted length before any correction, %",
        rows,
        values,
        note="100 |S_EXP - S_FEM| / S_FEM.",
    )


def _updated_table(
    rows: Sequence[PublishedMarker],
    base: Mapping[tuple[int, int], Lay | None],
    factors: Mapping[str, Factors],
    who: str,
) -> DataTable:
    recovered = published_weights()

    def values(row: PublishedMarker) -> Row:
        key = (row.case, row.marker)
        content: dict[str, Value] = {
            "paper, as printed": row.updated_error_pct,
            "paper, from its h": _corrected(row, row.simulation, recovered[row.case]),
        }
        for name, h in factors.items():
            content[name] = _corrected(row, base[key], h.get(key))
        return content

    return _table(
        8,
        "error of the predicted length after the learned weight, %",
        rows,
        values,
        note=f"100 |S_EXP - h S_FEM| / (h S_FEM). Ours correct the {who}. The paper's h are the "
        "twelve numbers that reproduce its Table 8; it does not print them.",
    )


def _corrected(row: PublishedMarker, lay: Lay | None, h: float | None) -> float | None:
    if lay is None or h is None or row.experiment is None:
        return None
    return length_error_pct(row.experiment.s, h * lay.s)


def _sides(
    row: PublishedMarker, ours: Mapping[tuple[int, int], Lay | None], who: str | None
) -> dict[str, Lay | None]:
    own = {} if who is None else {who: ours[row.case, row.marker]}
    return {**own, PAPER: row.simulation, EXPERIMENT: row.experiment}


def _places(
    sides: Mapping[str, Lay | None], quantity: str, unit: str, scale: float
) -> dict[str, Value]:
    return {
        f"{quantity} {name}, {unit}": getattr(lay, quantity.lower()) / scale if lay else None
        for name, lay in sides.items()
    }


def _gaps(
    sides: Mapping[str, Lay | None], quantity: str, unit: str, scale: float
) -> dict[str, Value]:
    wanted = sides[EXPERIMENT]
    field = quantity.lower()
    return {
        f"|d{quantity}| {name}, {unit}": abs(getattr(lay, field) - getattr(wanted, field)) / scale
        if lay and wanted
        else None
        for name, lay in sides.items()
        if name != EXPERIMENT
    }


def _table(
    number: int,
    title: str,
    rows: Sequence[PublishedMarker],
    values: Callable[[PublishedMarker], Row],
    *,
    digits: Mapping[str, int] | None = None,
    note: str = "",
) -> DataTable:
    content = [values(row) for row in rows]
    names = list(content[0]) if content else []
    columns = [
        Column(
            name=name,
            digits=(digits or {}).get(name, 2),
            mean=name.startswith("|") or number >= 7,
        )
        for name in names
    ]
    return DataTable(
        name=f"table_{number}",
        title=f"Table {number}: {title}",
        columns=(Column(name="case"), Column(name="marker"), *columns),
        rows=tuple(
            (row.case, f"P{row.marker}", *line.values())
            for row, line in zip(rows, content, strict=True)
        ),
        note=note,
    )


def _is(diameter: float, millimetres: int) -> bool:
    return abs(diameter / MILLIMETRE - millimetres) < 1.0e-6
