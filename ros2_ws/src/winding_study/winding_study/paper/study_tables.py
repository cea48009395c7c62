"""The study's own tables, beside the paper's: models of h, factors, means, every cell."""

from __future__ import annotations

import math
from collections.abc import Mapping

from correction_node.training.comparison import ModelScore
from winding_reports.documents.data_table import Column, DataTable, Value
from winding_study.paper.comparison import Comparison


def models_table(models: Mapping[str, ModelScore]) -> DataTable:
    """Return every model, the best on cases left out first."""
    order = sorted(models.items(), key=model_order)
    return DataTable(
        name="models",
        title="Every model of the weight h, mean error of a length in %",
        columns=(
            Column(name="model"),
            Column(name="kind"),
            Column(name="in-sample"),
            Column(name="± over seeds"),
            Column(name="case left out"),
            Column(name="± over seeds, left out"),
            Column(name="worst case left out"),
            Column(name="± bound, 12 of 13 cases", digits=1),
        ),
        rows=tuple(
            (
                name,
                model.kind,
                model.in_sample_pct,
                0.5 * model.in_sample_spread_pct,
                model.leave_one_case_out_pct,
                0.5 * model.leave_one_case_out_spread_pct,
                model.worst_case_pct,
                model.bound_pct,
            )
            for name, model in order
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
