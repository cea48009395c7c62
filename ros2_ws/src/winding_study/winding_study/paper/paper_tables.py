"""Tables 2 to 8 of the paper beside this project's numbers, and the study's own tables."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence

from correction_node.training.comparison import ModelScore
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
from winding_study.paper.case_result import CaseResult, Comparison

Row = Mapping[str, Value]
Factors = Mapping[tuple[int, int], float]  # h by (case, marker)

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
            name=name, digits=(digits or {}).get(name, 2), mean=name.startswith("|") or number >= 7
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


def models_table(models: Mapping[str, ModelScore]) -> DataTable:
    """Return every model, the best on cases left out first."""
    columns: dict[Column, Callable[[ModelScore], Value]] = {
        Column(name="kind"): lambda model: model.kind,
        Column(name="in-sample"): lambda model: model.in_sample_pct,
        Column(name="± over seeds"): lambda model: 0.5 * model.in_sample_spread_pct,
        Column(name="case left out"): lambda model: model.leave_one_case_out_pct,
        Column(name="± over seeds, left out"): lambda model: (
            0.5 * model.leave_one_case_out_spread_pct
        ),
        Column(name="worst case left out"): lambda model: model.worst_case_pct,
        Column(name="± bound, 12 of 13 cases", digits=1): lambda model: model.bound_pct,
    }
    return DataTable(
        name="models",
        title="Every model of the weight h, mean error of a length in %",
        columns=(Column(name="model"), *columns),
        rows=tuple(
            (name, *(value(model) for value in columns.values()))
            for name, model in sorted(models.items(), key=model_order)
        ),
        note="Over seeds: half of largest minus smallest. The bound is the largest residual of the "
        "left-out cases, in % of the corrected length.",
    )


def model_order(item: tuple[str, ModelScore]) -> tuple[bool, float]:
    """Sort key of (name, model): by the error on cases left out, floors last."""
    unseen = item[1].leave_one_case_out_pct
    known = math.isfinite(unseen)
    return not known, unseen if known else item[1].in_sample_pct


def factors_table(factors: Mapping[int, Mapping[str, float]]) -> DataTable:
    """Return one h per case by what it comes from."""
    names = list(next(iter(factors.values())))
    return DataTable(
        name="weights",
        title="One weight h for each case",
        columns=(
            Column(name="case"),
            *(Column(name=name.replace("_", " "), digits=4) for name in names),
        ),
        rows=tuple((case, *(row[name] for name in names)) for case, row in factors.items()),
        note="Least squares is the minimum of Eq. 5 when every case has its own h; the network has "
        "the paper's form.",
    )


def means_table(own: Comparison | None, paper: Comparison, who: str) -> DataTable:
    """Return the means of a prediction beside those of the paper's simulation.

    Args:
        own: The prediction beside the experiment; None when it is the paper's.
        paper: The paper's simulation on the same cells.
        who: Name of the prediction.
    """
    sides = {who: own, "paper's simulation": paper} if own is not None else {who: paper}
    labels = {
        "length error as in Table 7, %": "mean_error_pct",
        "|z - z_exp| marker by marker, mm": "mean_abs_dz_mm",
        "|z - z_exp| at the measured theta, mm": "mean_abs_dz_path_mm",
        "|theta - theta_exp|, rad": "mean_abs_dtheta_rad",
    }
    return DataTable(
        name="means",
        title=f"Means over {len(paper.cells)} measured markers",
        columns=(Column(name="mean"), *(Column(name=name) for name in sides)),
        rows=tuple(
            (label, *(getattr(side, name) for side in sides.values()))
            for label, name in labels.items()
        ),
    )


def cells_table(
    own: Comparison | None,
    paper: Comparison,
    updated: Mapping[str, Mapping[tuple[int, int], float]],
    who: str,
) -> DataTable:
    """Return Tables 2 to 8 in one: a row for each measured marker.

    Args:
        own: The prediction beside the experiment; None when it is the paper's.
        paper: The paper's simulation on the same cells.
        updated: Errors after a correction factor [%] by cell, by name of the model.
        who: Name of the prediction's columns.
    """
    sides = {who: own, "paper": paper} if own is not None else {"paper": paper}
    quantities = (("theta, rad", "theta", 1.0), ("z, mm", "z", 1e3), ("S, mm", "s", 1e3))
    units = {"theta": "rad", "z": "m", "s": "m"}
    rows: list[tuple[Value, ...]] = []
    for index, cell in enumerate(paper.cells):
        row: list[Value] = [cell.case, f"P{cell.marker}"]
        for _, name, scale in quantities:
            field = f"{name}_{units[name]}"
            row += [scale * float(getattr(side.cells[index], field)) for side in sides.values()]
            row.append(scale * float(getattr(cell, f"{name}_exp_{units[name]}")))
        row += [side.cells[index].error_pct for side in sides.values()]
        row += [errors.get((cell.case, cell.marker)) for errors in updated.values()]
        rows.append(tuple(row))
    names = [f"{what}: {side}" for what, *_ in quantities for side in (*sides, "exp.")]
    return DataTable(
        name="cells",
        title="Every measured marker: prediction, the paper's simulation, the experiment"
        if own is not None
        else "Every measured marker: the paper's simulation, the experiment",
        columns=(
            Column(name="case"),
            Column(name="marker"),
            *(Column(name=name) for name in names),
            *(Column(name=f"error, %: {side}", mean=True) for side in sides),
            *(Column(name=f"after h, %: {name}", mean=True) for name in updated),
        ),
        rows=tuple(rows),
    )
