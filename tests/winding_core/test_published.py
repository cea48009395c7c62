"""The paper's tables agree with each other and with what was wound."""

from __future__ import annotations

import math

import numpy as np
import pytest

from winding_core.cable.cases import (
    Lay,
    PublishedMarker,
    length_error_pct,
    paper_case,
    paper_cases,
    published_conditions,
    published_markers,
    published_weights,
)
from winding_core.helix import curve_length

MEASURED = [(row, row.experiment) for row in published_markers() if row.experiment is not None]

# What a table computed from lengths printed to 0.01 mm, and itself printed to 0.01 %, may miss.
TABLE_BAR = 0.01


def _length(row: PublishedMarker, lay: Lay) -> float:
    return curve_length(paper_case(row.case).centreline_radius, lay.theta, lay.z)


def test_every_case_has_four_markers_and_three_were_not_reached() -> None:
    assert [(r.case, r.marker) for r in published_markers()] == [
        (case, marker) for case in range(1, 13) for marker in range(1, 5)
    ]
    missing = [(r.case, r.marker) for r in published_markers() if r.experiment is None]
    assert missing == [(2, 4), (7, 4), (8, 4)]
    assert all(r.error_pct is None for r in published_markers() if r.experiment is None)


def test_tables_five_and_six_follow_from_tables_two_to_four() -> None:
    lays = [(r, r.simulation) for r in published_markers()]
    lays += MEASURED
    assert len(lays) == 93
    for row, lay in lays:
        # Angles are printed to 0.01 rad: half of that on 33 mm is 0.165 mm; z adds less.
        assert _length(row, lay) == pytest.approx(lay.s, abs=0.2e-3), (row.case, row.marker)


def test_table_seven_follows_from_tables_five_and_six() -> None:
    for row, measured in MEASURED:
        error = length_error_pct(measured.s, row.simulation.s)
        assert error == pytest.approx(row.error_pct, abs=TABLE_BAR), (row.case, row.marker)


def test_table_eight_follows_from_twelve_weights() -> None:
    h = published_weights()
    assert sorted(h) == list(range(1, 13))
    for row, measured in MEASURED:
        error = length_error_pct(measured.s, h[row.case] * row.simulation.s)
        assert error == pytest.approx(row.updated_error_pct, abs=TABLE_BAR), (row.case, row.marker)


def test_the_means_are_the_papers_numbers() -> None:
    # 45 values of two decimals.
    assert np.mean([row.error_pct for row, _ in MEASURED]) == pytest.approx(12.04, abs=0.005)
    assert np.mean([row.updated_error_pct for row, _ in MEASURED]) == pytest.approx(4.81, abs=0.005)


def test_original_lengths_are_marker_spacings() -> None:
    for row in published_markers():
        assert row.original_length == pytest.approx(
            paper_case(row.case).original_length(row.marker)
        )


def test_cable_only_gets_longer_along_itself() -> None:
    for case in range(1, 13):
        rows = published_markers(case)
        assert (np.diff([r.simulation.z for r in rows]) > 0.0).all()
        measured = [r.experiment for r in rows if r.experiment]
        assert (np.diff([lay.theta for lay in measured]) > 0.0).all()
        assert (np.diff([lay.s for lay in measured]) > 0.0).all()


def test_table_one_has_twelve_cases_in_order() -> None:
    assert [case.number for case in paper_cases()] == list(range(1, 13))
    assert {case.cylinder_diameter for case in paper_cases()} == {0.03, 0.06}
    assert {case.cable_diameter for case in paper_cases()} == {0.002, 0.004, 0.006}


def test_the_printed_tension_is_weight_over_section() -> None:
    for case in paper_cases():
        printed = published_conditions()[case.number].nominal_stress
        # Four printed digits: half a unit of the fourth is at most 5e-4 of the value.
        assert case.nominal_stress == pytest.approx(printed, rel=5e-4)


def test_two_weights_hang_on_every_cable() -> None:
    g = 9.81
    for case in paper_cases():
        # 200 g and 400 g; Table 1's four digits of stress give the weight to 1 mN.
        assert min(abs(case.weight - m * g) for m in (0.2, 0.4)) < 1.5e-3


def test_markers_are_one_turn_of_their_cylinder_apart() -> None:
    assert {(c.cylinder_diameter, c.marker_spacing) for c in paper_cases()} == {
        (0.03, 0.1),
        (0.06, 0.2),
    }


def test_radii_and_section_follow_from_diameters() -> None:
    case = paper_case(3)
    assert case.centreline_radius == pytest.approx(0.017)
    assert case.section_area == pytest.approx(math.pi * 4.0e-6)
    assert case.original_length(3) == pytest.approx(0.3)
