"""Parameters: one statement, one clear sentence for whatever is wrong."""

import pytest

from winding_core.cable.condition import Condition
from winding_core.parameters import ParameterError, build, declarations


def refused(**values: object) -> str:
    with pytest.raises(ParameterError) as caught:
        build(Condition, values, owner="node /winding/rig").resolved()
    return str(caught.value)


def test_defaults_are_case_four() -> None:
    assert build(Condition, {}, owner="test").resolved().case.number == 4


def test_whole_number_is_taken_for_a_float() -> None:
    assert build(Condition, {"duration": 12}, owner="test").duration == 12.0


def test_unknown_name_is_refused_with_the_nearest() -> None:
    assert refused(cylinder_diamter=0.03) == (
        "node /winding/rig has no parameter cylinder_diamter; did you mean cylinder_diameter?"
    )


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"case": 13}, "case must be one of 1 to 12, got 13"),
        ({"case": -1}, "parameter case must be positive, got -1"),
        ({"case": "four"}, "parameter case must be a int, got 'four'"),
        ({"case": True}, "parameter case must be a int, got True"),
        ({"duration": float("nan")}, "parameter duration must be finite, got nan"),
        ({"duration": 4000.0}, "parameter duration must be at most 3600, got 4000"),
        ({"cable_diameter": -0.002}, "parameter cable_diameter must be positive, got -0.002"),
        ({"weight": 2.0, "nominal_stress": 1.0e6}, "give the tension once: weight or nominal"),
        (
            {"case": 0, "cylinder_diameter": 0.03, "cable_diameter": 0.004, "marker_spacing": 0.1},
            "give case, or a whole condition: missing weight or nominal_stress",
        ),
    ],
)
def test_bad_value_is_refused_with_value_and_limit(
    values: dict[str, object], sentence: str
) -> None:
    assert refused(**values).startswith(sentence)


def test_every_parameter_says_what_it_is() -> None:
    for item in declarations(Condition):
        assert item.description
