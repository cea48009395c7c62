from __future__ import annotations

import dataclasses
import math

import pytest

from winding_core.cable.cases import Case, Material, paper_case, paper_cases, published_conditions

OWN = {
    "cylinder_diameter": 0.045,
    "cable_diameter": 0.003,
    "weight": 2.5,
    "marker_spacing": 0.15,
}


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


@pytest.mark.parametrize("number", [0, 13, -1])
def test_a_case_outside_table_one_is_refused(number: int) -> None:
    with pytest.raises(ValueError, match=f"case must be one of 1 to 12, got {number}"):
        paper_case(number)


@pytest.mark.parametrize("name", list(OWN))
@pytest.mark.parametrize("value", [0.0, -0.002, math.nan, math.inf])
def test_an_impossible_condition_is_refused_by_name(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"^{name} must be positive and finite"):
        Case(**{**OWN, name: value})


def test_a_cable_without_markers_is_refused() -> None:
    with pytest.raises(ValueError, match="marker_count must be at least 1, got 0"):
        Case(**OWN, marker_count=0)


@pytest.mark.parametrize("name", ["young", "density"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan])
def test_an_impossible_material_is_refused_by_name(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"^{name} must be positive"):
        Material(**{name: value})


@pytest.mark.parametrize("poisson", [0.5, -0.1, math.nan])
def test_poisson_stays_below_incompressible(poisson: float) -> None:
    with pytest.raises(ValueError, match="poisson must lie in"):
        Material(poisson=poisson)


def test_a_case_cannot_be_changed_behind_ones_back() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        paper_case(4).weight = 1.0  # type: ignore[misc]
