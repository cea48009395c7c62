"""`winding track` needs what lies in the picture, and states what it assumes of it."""

from typing import Any

import pytest

from winding_cli.commands.track import tracked_condition
from winding_core.parameters import ParameterError

OWN = {"cylinder_diameter_mm": 40.0, "cable_diameter_mm": 3.0}


def test_a_cable_without_a_tension_is_expected_as_long_as_it_was_made() -> None:
    wound, remarks = tracked_condition(OWN)
    case = wound.resolved().case
    assert case.cylinder_diameter == pytest.approx(0.04)
    # The least tension of a condition, a millinewton, on the paper's cable.
    assert case.expected_stretch == pytest.approx(1.0, abs=1.0e-4)
    assert remarks == ()


@pytest.mark.parametrize("tension", [{"tension_n": 2.0}, {"tension_mpa": 0.3}])
def test_a_tension_that_is_given_is_expected_to_stretch(tension: dict[str, Any]) -> None:
    wound, _ = tracked_condition({**OWN, **tension})
    assert wound.resolved().case.expected_stretch > 1.05


def test_what_is_missing_does_not_include_the_tension() -> None:
    with pytest.raises(ParameterError, match=r"missing --cable-diameter-mm$"):
        tracked_condition({"cylinder_diameter_mm": 40.0})


def test_a_case_that_is_assumed_is_reported() -> None:
    wound, (remark,) = tracked_condition({})
    assert remark == f"no cylinder and cable are given: those of case {wound.case} are assumed"
    assert tracked_condition({"case": 9})[1] == ()


def test_a_case_keeps_its_tension_on_another_cylinder() -> None:
    wound, _ = tracked_condition({"case": 9, "cylinder_diameter_mm": 40.0})
    # 200 g, as in Table 1.
    assert wound.resolved().case.weight == pytest.approx(1.962)
