from __future__ import annotations

import math

import numpy as np
import pytest

from correction_node.models.dataset import (
    INPUTS,
    condition_inputs,
    conditions_of,
    dimensionless_inputs,
    format_lengths,
    lengths,
    load_data_set,
    parse_lengths,
)
from winding_core.cable.cases import paper_case, paper_cases, published_markers

HEADER = "case,marker,s_fem_m\n"


def test_the_papers_own_column_gives_its_45_measured_cells() -> None:
    cells = load_data_set("paper").cells
    assert len(cells) == 45
    measured = [row for row in published_markers() if row.experiment is not None]
    s_fem, s_exp = lengths(cells)
    assert s_fem.tolist() == [row.simulation.s for row in measured]
    assert s_exp.tolist() == [row.experiment.s for row in measured if row.experiment]


def test_a_cell_carries_its_condition_in_si() -> None:
    cell = load_data_set("paper").cells[0]
    assert (cell.case, cell.marker) == (1, 1)
    assert cell.cylinder_diameter == pytest.approx(0.030)
    assert cell.cable_diameter == pytest.approx(0.002)
    # 1.962 N over pi mm^2, by hand.
    assert cell.tension == pytest.approx(1.962 / (math.pi * 1.0e-6))
    assert cell.original_length == pytest.approx(0.1)


def test_lengths_survive_the_way_through_a_file() -> None:
    rows = [(1, 1, 0.124), (12, 4, 0.84321)]
    assert parse_lengths(format_lengths(rows), source="x") == {(1, 1): 0.124, (12, 4): 0.84321}


def test_a_wrong_table_is_refused_with_its_place() -> None:
    for text, sentence in [
        ("case,marker\n1,1\n", "no column s_fem_m"),
        ("", "no column case"),
        (HEADER + "1,1,nan\n", "must be positive, got nan"),
        (HEADER + "1,1,inf\n", "must be positive, got inf"),
        (HEADER + "1,1,-0.1\n", "must be positive, got -0.1"),
        (HEADER + "1,1,0\n", "must be positive, got 0"),
        (HEADER + "1,1,\n", "line 2 is not"),
        (HEADER + "1,1\n", "line 2 is not"),
        (HEADER + "1,one,0.1\n", "line 2 is not"),
        (HEADER + "1,1,0.1\n1,1,0.2\n", "stands twice"),
    ]:
        with pytest.raises(ValueError, match=sentence):
            parse_lengths(text, source="table.csv")


def test_a_table_that_leaves_a_measured_marker_out_is_refused(tmp_path) -> None:
    path = tmp_path / "part.csv"
    path.write_text(HEADER + "1,1,0.12\n")
    with pytest.raises(ValueError, match="no length of case 1 marker 2"):
        load_data_set(str(path))


def test_a_missing_file_is_named() -> None:
    with pytest.raises(FileNotFoundError, match=r"no data set nowhere\.csv"):
        load_data_set("nowhere.csv")


def test_the_digest_follows_every_number(tmp_path) -> None:
    rows = [(m.case, m.marker, m.simulation.s) for m in published_markers()]
    path = tmp_path / "lengths.csv"
    path.write_text(format_lengths(rows))
    same = load_data_set(str(path))
    assert same.sha256 == load_data_set("paper").sha256
    rows[7] = (rows[7][0], rows[7][1], rows[7][2] + 1.0e-6)
    path.write_text(format_lengths(rows))
    assert (same.sha256 == load_data_set(str(path)).sha256) == (
        published_markers()[7].experiment is None
    )


CELLS = load_data_set("rod").cells


def test_training_and_running_see_the_same_inputs() -> None:
    for name in INPUTS:
        inputs = INPUTS[name]
        for case in paper_cases():
            trained = inputs([cell for cell in CELLS if cell.case == case.number])
            # Weight over area and back: rounding.
            np.testing.assert_allclose(
                inputs(conditions_of(case, "linear"))[: len(trained)], trained, rtol=1e-12
            )


def test_dimensionless_inputs_by_hand() -> None:
    # Case 1: 1.962 N on pi mm^2 of 2.6 MPa, 30 mm over 2 mm, P1 after 100 mm.
    first = dimensionless_inputs(CELLS)[0]
    strain = 1.962 / (math.pi * 1.0e-6) / 2.6e6
    assert first == pytest.approx([math.log(strain), math.log(15.0), 0.1 / (math.pi * 0.03)])


def test_the_papers_inputs_are_the_same_for_all_markers_of_a_case() -> None:
    for case in range(1, 13):
        rows = condition_inputs([cell for cell in CELLS if cell.case == case])
        assert (rows == rows[0]).all()


def test_the_quasi_static_reference_is_the_rod() -> None:
    reference = {
        (case.number, c.marker): c.s_fem
        for case in paper_cases()
        for c in conditions_of(case, "linear")
    }
    ratio = np.array([reference[cell.case, cell.marker] / cell.s_fem for cell in CELLS])
    # Measured: 0.14 % at most, the stiff cable's lift-off and the ramp.
    np.testing.assert_allclose(ratio, 1.0, atol=1.5e-3)


def test_every_marker_of_a_case_has_its_condition() -> None:
    case = paper_case(2)
    assert [c.marker for c in conditions_of(case, "linear")] == [1, 2, 3, 4]
