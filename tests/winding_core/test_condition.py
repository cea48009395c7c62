"""One condition: what typed options mean, and what stays a case of the paper."""

import math

import pytest

from winding_core.cable.cases import Material, paper_case
from winding_core.cable.condition import Condition
from winding_core.helix import PAPER_FREE_LENGTH, guide_distance_of
from winding_core.machine.tension import DeadWeight, RigTension
from winding_core.parameters import ParameterError, options, shown_values


def refused(**typed: object) -> str:
    with pytest.raises(ParameterError) as caught:
        Condition.from_typed(typed, spelling=lambda key: f"--{key.replace('_', '-')}")
    return str(caught.value)


def test_a_case_stays_the_paper_s() -> None:
    what = Condition.from_typed({"case": 7}).resolved()
    assert what.case == paper_case(7)
    assert what.case.is_published
    assert (what.free_length, what.tension_law) == (PAPER_FREE_LENGTH, DeadWeight())


@pytest.mark.parametrize("typed", [{"young_mpa": 4.0}, {"tension_n": 2.0}, {"axial_factor": 0.9}])
def test_another_cable_is_no_case_of_the_paper(typed: dict[str, object]) -> None:
    case = Condition.from_typed({"case": 4, **typed}).resolved().case
    assert case.number == 0
    assert not case.is_published


def test_further_markers_keep_the_case_and_were_not_measured() -> None:
    case = Condition.from_typed({"case": 4, "markers": 6}).resolved().case
    assert (case.number, case.marker_count) == (4, 6)
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


@pytest.mark.parametrize(
    ("typed", "sentence"),
    [
        ({}, "say what to wind: --case 1 to 12, or --cylinder-diameter-mm, --cable-diameter-mm"),
        ({"case": 0}, "--case must be one of 1 to 12, got 0"),
        ({"case": 4, "young_mpa": -4.0}, "--young-mpa must be positive, got -4"),
        ({"case": 4, "poisson": 0.5}, "--poisson must be at most 0.4999, got 0.5"),
        ({"case": 4, "law": "soft"}, "--law must be one of linear, hencky"),
        ({"case": 4, "tension_n": 1.0, "tension_mpa": 1.0}, "give the tension once: --tension-n"),
        ({"case": 4, "guide_distance_mm": 15.0}, "--guide-distance-mm must exceed"),
        (
            {"case": 4, "guide_distance_mm": 250.0, "free_length_mm": 150.0},
            "give --guide-distance-mm or --free-length-mm, not both",
        ),
        ({"cable_diameter_mm": 3.0}, "missing --cylinder-diameter-mm, --tension-n or --tension"),
        ({"case": 4, "duration_s": math.nan}, "--duration-s must be finite, got nan"),
    ],
)
def test_refusal_names_option_and_unit(typed: dict[str, object], sentence: str) -> None:
    assert sentence in refused(**typed)


def test_what_is_shown_can_be_typed_again() -> None:
    condition = Condition.from_typed({"case": 4, "young_mpa": 3.1, "feed_mm_s": 7.0})
    values = {item.name: getattr(condition, item.name) for item in options(Condition).values()}
    shown = shown_values(Condition, values)
    again = Condition.from_typed({key: value for key, value in shown.items() if value != 0.0})
    assert again == condition
