"""The page's drawing of an arm: its joints, the eye on its span, and nothing without a file."""

import re
from dataclasses import replace

import numpy as np
import pytest
from arm_example import EXAMPLE

from winding_core.cable.cases import paper_case
from winding_core.machine.readings import AxisReading, GuidePlace
from winding_core.markers import MARKER_DTYPE
from winding_dashboard.drawings.arm_view import SIZE, ArmView
from winding_dashboard.state.view_state import ViewState

CASE = paper_case(4)
PLACE = GuidePlace.beside(CASE.centreline_radius, 0.198)


@pytest.fixture
def state() -> ViewState:
    made = ViewState(nodes=(), machine="winding_rig", solver="cable_fem")
    made.predicted = np.zeros(1, dtype=MARKER_DTYPE)
    made.predicted["r"], made.cable_radius = CASE.centreline_radius, CASE.cable_radius
    made.axes = replace(AxisReading.of_positions(0.0, 0.05), guide=PLACE)
    return made


def numbers(pattern: str, svg: str) -> list[list[float]]:
    return [[float(item) for item in found] for found in re.findall(pattern, svg)]


def test_both_views_show_every_joint_inside_the_picture(state: ViewState) -> None:
    svg = ArmView(str(EXAMPLE)).svg(state)
    joints = numbers(r'<circle cx="([\d.]+)" cy="([\d.]+)" r="3.6"', svg)
    # Base and six joints, twice.
    assert len(joints) == 14
    assert all(0.0 < u < SIZE[0] and 0.0 < v < SIZE[1] for u, v in joints)


def test_span_is_drawn_from_the_eye_to_the_top_of_the_cylinder(state: ViewState) -> None:
    svg = ArmView(str(EXAMPLE)).svg(state)
    ((u, v, w, x), _) = numbers(
        r'<line x1="([\d.]+)" y1="([\d.]+)" x2="([\d.]+)" y2="([\d.]+)"', svg
    )
    ((centre, middle, radius),) = numbers(
        r'<circle cx="([\d.]+)" cy="([\d.]+)" r="([\d.]+)" fill="#242d36"', svg
    )
    # Pixels are written to a tenth.
    assert (w, x) == pytest.approx((centre, v), abs=0.2)
    scale = radius / CASE.cylinder_radius
    assert w - u == pytest.approx(0.198 * scale, abs=0.3)
    assert middle - x == pytest.approx(CASE.centreline_radius * scale, abs=0.3)


def test_nothing_is_drawn_without_an_arm_or_before_its_guide_is_known(state: ViewState) -> None:
    assert ArmView().svg(state) == ""
    state.axes = AxisReading.of_positions(0.0, 0.05)
    assert ArmView(str(EXAMPLE)).svg(state) == ""
