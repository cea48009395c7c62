from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad

from winding_core.cable.cases import paper_cases
from winding_core.helix import curve_length, lead_angle, pitch, turn_length

RADIUS = 0.016
PITCH = 0.01805513


def test_pitch_and_lead_angle_undo_each_other() -> None:
    # Rounding of tan and atan.
    assert pitch(lead_angle(PITCH, 0.015), 0.015) == pytest.approx(PITCH, rel=1e-14)


def test_a_steep_helix_climbs_its_circumference_at_45_degrees() -> None:
    assert lead_angle(2.0 * math.pi * 0.03, 0.03) == pytest.approx(math.pi / 4.0)


def test_one_turn_is_as_long_as_the_curve_itself() -> None:
    slope = PITCH / (2.0 * math.pi)

    def speed(theta: float) -> float:
        tangent = (-RADIUS * math.sin(theta), RADIUS * math.cos(theta), slope)
        return math.hypot(*tangent)

    integral, error = quad(speed, 0.0, 2.0 * math.pi)
    assert turn_length(RADIUS, PITCH) == pytest.approx(integral, abs=10.0 * error)


def test_equation_three_as_printed_is_a_misprint() -> None:
    printed = math.sqrt(2.0 * math.pi * RADIUS**2 + PITCH**2)
    # One turn cannot be shorter than its circumference of 100.5 mm; the print gives 44 mm.
    assert printed < 2.0 * math.pi * RADIUS < turn_length(RADIUS, PITCH)
    assert turn_length(RADIUS, PITCH) == pytest.approx(0.102139404, rel=1e-6)


def test_a_marker_spacing_of_the_paper_is_about_one_turn() -> None:
    for case in paper_cases():
        turn = turn_length(case.centreline_radius, PITCH)
        # One round spacing serves three cable radii per cylinder: 16 to 18 mm is 12 %.
        assert case.marker_spacing == pytest.approx(turn, rel=0.13)


def test_curve_length_adds_up_over_turns() -> None:
    assert curve_length(RADIUS, 4.0 * 2.0 * math.pi, 4.0 * PITCH) == pytest.approx(
        4.0 * turn_length(RADIUS, PITCH), rel=1e-14
    )


def test_a_flat_winding_is_as_long_as_its_arc() -> None:
    assert curve_length(RADIUS, 3.0, 0.0) == pytest.approx(0.048)
    assert curve_length(RADIUS, 0.0, 0.25) == 0.25


def test_curve_length_takes_arrays_and_keeps_scalars_plain() -> None:
    lengths = curve_length(RADIUS, np.array([0.0, 1.0]), np.array([0.0, 0.0]))
    assert lengths.tolist() == [0.0, RADIUS]
    assert type(curve_length(RADIUS, 1.0, 0.0)) is float


def test_direction_does_not_change_length() -> None:
    assert curve_length(RADIUS, -7.0, 0.02) == curve_length(RADIUS, 7.0, -0.02)


@pytest.mark.parametrize("radius", [0.0, -0.01, math.nan, math.inf])
def test_an_impossible_radius_is_refused(radius: float) -> None:
    for refuse in (
        lambda: lead_angle(0.01, radius),
        lambda: pitch(0.1, radius),
        lambda: turn_length(radius, 0.01),
        lambda: curve_length(radius, 1.0, 0.0),
    ):
        with pytest.raises(ValueError, match="radius must be positive and finite"):
            refuse()
