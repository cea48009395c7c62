from __future__ import annotations

import csv
import io
import json
import math

import pytest

from winding_core.cable.cases import Lay, published_markers, published_weights
from winding_reports.documents.data_table import Column, DataTable
from winding_study.paper.case_result import CaseResult
from winding_study.paper.paper_tables import paper_tables

ALL = range(1, 13)


def _results(factor: float) -> list[CaseResult]:
    """A solver that lays every marker at so many times the measured angle, z and length."""
    return [
        CaseResult(
            case=case,
            lays={
                row.marker: Lay(
                    theta=factor * row.experiment.theta,
                    z=factor * row.experiment.z,
                    s=factor * row.experiment.s,
                )
                for row in published_markers(case)
                if row.experiment
            },
            path_z={},
            energy_balance_pct=0.0,
            cpu_seconds=0.0,
        )
        for case in ALL
    ]


def _tables(results=(), weights=None, cases=ALL) -> dict[str, DataTable]:
    tables = paper_tables(results, cases, weights or {}, "rod")
    return {table.name: table for table in tables}


def test_every_table_has_a_row_for_every_marker() -> None:
    rows = {name: len(table.rows) for name, table in _tables(_results(1.0)).items()}
    assert rows == {
        "table_2": 16,
        "table_3": 16,
        "table_4": 16,
        "table_5": 24,
        "table_6": 24,
        "table_7": 48,
        "table_8": 48,
    }


def test_the_recovered_weights_give_table_8_as_printed() -> None:
    table = _tables()["table_8"]
    printed, ours = table.column("paper, as printed"), table.column("paper, from its h")
    pairs = [(a, b) for a, b in zip(printed, ours, strict=True) if a is not None]
    assert len(pairs) == 45
    # The bar of the study; what the printed lengths' two decimals leave open is 0.005.
    assert max(abs(a - b) for a, b in pairs) <= 0.02


def test_table_7_follows_from_the_printed_lengths() -> None:
    table = _tables()["table_7"]
    pairs = zip(
        table.column("paper, as printed"), table.column("paper, from its lengths"), strict=True
    )
    # Both lengths are printed to 0.01 mm of at least 98 mm, and the error to 0.01 %.
    assert all(a == pytest.approx(b, abs=0.02) for a, b in pairs if a is not None)


def test_our_columns_are_what_was_wound_beside_the_experiment() -> None:
    tables = _tables(_results(1.1))
    for name in ("table_2", "table_3", "table_4"):
        theta = tables[name].column("theta rod, rad")
        measured = tables[name].column("theta experiment, rad")
        gap = tables[name].column("|dtheta| rod, rad")
        for ours, theirs, difference in zip(theta, measured, gap, strict=True):
            if theirs is not None:
                assert ours == pytest.approx(1.1 * theirs, rel=1e-12)
                assert difference == pytest.approx(0.1 * theirs, rel=1e-9)
    # 100 |S - 1.1 S| / (1.1 S)
    assert tables["table_7"].means["rod"] == pytest.approx(100.0 * 0.1 / 1.1, rel=1e-9)


def test_markers_that_were_not_measured_stay_empty() -> None:
    table = _tables(_results(1.0))["table_2"]
    row = next(row for row in table.rows if row[:2] == (7, "P4"))
    values = dict(zip([column.name for column in table.columns], row, strict=True))
    assert values["theta experiment, rad"] is None
    assert values["|dtheta| paper, rad"] is None
    assert values["theta paper, rad"] == 25.75


def test_the_right_weight_leaves_no_error_in_table_8() -> None:
    exact = {(row.case, row.marker): 1.0 / 1.1 for row in published_markers()}
    table = _tables(_results(1.1), {"exact": exact})["table_8"]
    assert table.means["exact"] == pytest.approx(0.0, abs=1e-9)


def test_without_a_solver_of_ours_the_papers_simulation_is_corrected() -> None:
    h = {(row.case, row.marker): published_weights()[row.case] for row in published_markers()}
    tables = _tables((), {"again": h})
    table = tables["table_8"]
    assert table.column("again") == table.column("paper, from its h")
    assert not any("rod" in column.name for t in tables.values() for column in t.columns)


def test_only_the_asked_cases_are_there() -> None:
    tables = _tables(_results(1.0)[3:4], cases=(4,))
    assert {row[0] for row in tables["table_7"].rows} == {4}
    assert tables["table_6"].rows == ()


def test_csv_and_json_carry_every_digit_and_no_nan() -> None:
    table = DataTable(
        name="t",
        title="a table",
        columns=(Column(name="case"), Column(name="x, mm", mean=True), Column(name="who")),
        rows=((1, 1.0 / 3.0, "a"), (1, math.nan, "b"), (2, None, "c, d")),
    )
    names, *rows = csv.reader(io.StringIO(table.as_csv()))
    assert names == ["case", "x, mm", "who"]
    assert float(rows[0][1]) == 1.0 / 3.0
    assert [row[1] for row in rows[1:]] == ["", ""]
    assert rows[2][2] == "c, d"
    again = json.loads(json.dumps(table.as_json(), allow_nan=False))
    assert again["rows"] == [[1, 1.0 / 3.0, "a"], [1, None, "b"], [2, None, "c, d"]]


def test_shown_rows_name_a_group_once_and_round() -> None:
    table = DataTable(
        name="t",
        title="a table",
        columns=(Column(name="case"), Column(name="x", digits=1, mean=True)),
        rows=((1, 0.26), (1, 0.14), (2, None)),
    )
    assert table.texts() == [["1", "0.3"], ["", "0.1"], ["2", "–"]]
    assert table.mean_texts() == ["mean", "0.2"]
    assert table.worded == [False, False]
