"""Conditions: what typed options mean, and the paper's cases and tables."""

import csv
import math
from importlib.resources import files

import numpy as np
import pytest

from winding_core.cable.cases import (
    Lay,
    Material,
    PublishedMarker,
    length_error_pct,
    paper_case,
    paper_cases,
    published_markers,
    published_weights,
)
from winding_core.cable.condition import Condition
from winding_core.cable.prony import PronySeries
from winding_core.helix import PAPER_FREE_LENGTH, curve_length, guide_distance_of
from winding_core.machine.tension import DeadWeight, RigTension
from winding_core.parameters import ParameterError, options, shown_values

MEASURED = [(row, row.experiment) for row in published_markers() if row.experiment is not None]
# What a table computed from lengths printed to 0.01 mm, and itself printed to 0.01 %, may miss.
TABLE_BAR = 0.01


def test_a_case_stays_the_paper_s() -> None:
    what = Condition.from_typed({"case": 7}).resolved()
    assert what.case == paper_case(7)
    assert what.case.is_published
    assert (what.free_length, what.tension_law) == (PAPER_FREE_LENGTH, DeadWeight())


@pytest.mark.parametrize(
    ("typed", "number", "markers"),
    [
        ({"young_mpa": 4.0}, 0, 4),
        ({"tension_n": 2.0}, 0, 4),
        ({"axial_factor": 0.9}, 0, 4),
        # Further markers keep the case, and were not measured.
        ({"markers": 6}, 4, 6),
    ],
)
def test_own_cable_is_not_published(typed: dict[str, object], number: int, markers: int) -> None:
    case = Condition.from_typed({"case": 4, **typed}).resolved().case
    assert (case.number, case.marker_count) == (number, markers)
    assert not case.is_published


def test_another_cable_is_spelled_out_in_typed_units() -> None:
    typed = {"cylinder_diameter_mm": 50.0, "cable_diameter_mm": 3.0, "tension_mpa": 0.5}
    case = Condition.from_typed(typed).resolved().case
    assert (case.cylinder_diameter, case.cable_diameter) == (0.05, 0.003)
    assert case.nominal_stress == pytest.approx(0.5e6)
    assert case.marker_spacing == 0.1


def test_material_is_taken_whole() -> None:
    typed = {"case": 4, "young_mpa": 4.0, "poisson": 0.0, "density": 900.0, "bending_factor": 0.5}
    assert Condition.from_typed(typed).resolved().case.material == Material(
        young=4.0e6, poisson=0.0, density=900.0, bending_factor=0.5
    )


def test_guide_distance_stands_for_the_span() -> None:
    what = Condition.from_typed({"case": 4, "guide_distance_mm": 250.0}).resolved()
    assert guide_distance_of(what.free_length, what.case.centreline_radius) == pytest.approx(0.25)


def test_rig_tension_is_wound_where_it_is_not_the_dead_weight() -> None:
    what = Condition.from_typed({"case": 4, "tension_start_share": 0.4}).resolved()
    assert what.tension_law == RigTension(start_share=0.4)


def test_the_tension_changes_with_the_cylinder_over_a_reference_of_one_s_own() -> None:
    typed = {"cylinder_diameter_mm": 300, "cable_diameter_mm": 8, "tension_n": 5000}
    rig = {"tension_diameter_gain_n": 800, "tension_reference_diameter_mm": 200}
    law = Condition.from_typed({**typed, **rig, "tension_offset_n": -100}).resolved().tension_law
    # F0 + T + b (D / D0 - 1), at two diameters of the cylinder.
    assert law(5000.0, 0.3, 0.0) == pytest.approx(-100.0 + 5000.0 + 800.0 * 0.5)
    assert law(5000.0, 0.2, 0.0) == pytest.approx(-100.0 + 5000.0)


def test_what_is_shown_can_be_typed_again() -> None:
    condition = Condition.from_typed({"case": 4, "young_mpa": 3.1, "feed_mm_s": 7.0})
    values = {item.name: getattr(condition, item.name) for item in options(Condition).values()}
    shown = shown_values(Condition, values)
    again = Condition.from_typed({key: value for key, value in shown.items() if value != 0.0})
    assert again == condition


def test_terms_are_read_in_order() -> None:
    series = PronySeries.parse("0.2:1.5 + 0.1:1e+3")
    assert series == PronySeries(shares=(0.2, 0.1), times=(1.5, 1000.0))
    assert series.left == pytest.approx(0.7)
    assert PronySeries.parse("") == PronySeries.parse(" ") == PronySeries()


def test_creep_of_one_term_is_that_of_the_standard_linear_solid() -> None:
    t = np.linspace(0.0, 20.0, 50)
    exact = 1.0 + 0.3 / 0.7 * (1.0 - np.exp(-0.7 * t / 2.0))
    np.testing.assert_allclose(PronySeries.parse("0.3:2").creep(t), exact, rtol=1.0e-12)


def test_creep_of_several_terms_solves_their_equations() -> None:
    series = PronySeries.parse("0.2:0.5+0.1:30+0.15:3")
    g, tau = np.array(series.shares), np.array(series.times)
    q, step = np.zeros(3), 1.0e-3
    for _ in range(5000):
        rate = (g * (1.0 + q.sum()) - q) / tau
        middle = q + 0.5 * step * rate
        q += step * (g * (1.0 + middle.sum()) - middle) / tau
    # The midpoint rule's error of second order.
    assert series.creep(5.0) == pytest.approx(1.0 + q.sum(), rel=1.0e-6)
    assert series.creep(1.0e6) == pytest.approx(1.0 / series.left, rel=1.0e-9)


def test_a_condition_takes_it_and_is_no_longer_the_paper_s() -> None:
    case = Condition(case=4, prony="0.2:1.5").resolved().case
    assert case.material.prony.times == (1.5,)
    assert not case.is_published
    with pytest.raises(ParameterError, match=r"^--prony needs terms"):
        Condition.from_typed({"case": 4, "prony": "soft"}, spelling=lambda key: f"--{key}")


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
    assert len(MEASURED) == 45
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
    assert len(published_markers()) >= 45
    for row in published_markers():
        assert row.original_length == pytest.approx(
            paper_case(row.case).original_length(row.marker)
        )


def test_cable_only_gets_longer_along_itself() -> None:
    for case in range(1, 13):
        rows = published_markers(case)
        assert (np.diff([r.simulation.z for r in rows]) > 0.0).all()
        measured = [r.experiment for r in rows if r.experiment]
        assert len(measured) >= 3
        assert (np.diff([lay.theta for lay in measured]) > 0.0).all()
        assert (np.diff([lay.s for lay in measured]) > 0.0).all()


def test_table_one_has_twelve_cases_in_order() -> None:
    assert [case.number for case in paper_cases()] == list(range(1, 13))
    assert {case.cylinder_diameter for case in paper_cases()} == {0.03, 0.06}
    assert {case.cable_diameter for case in paper_cases()} == {0.002, 0.004, 0.006}


def test_the_printed_tension_is_weight_over_section() -> None:
    table = files("winding_core").joinpath("data", "cases.csv").read_text(encoding="utf-8")
    for case, row in zip(paper_cases(), csv.DictReader(table.splitlines()), strict=True):
        printed = 1.0e6 * float(row["tension_mpa"])
        # Four printed digits: half a unit of the fourth is at most 5e-4 of the value.
        assert case.nominal_stress == pytest.approx(printed, rel=5e-4)


def test_two_weights_hang_on_every_cable() -> None:
    assert len(paper_cases()) == 12
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
