"""The lag law and the rounding of corners, against their closed forms."""

import math
from dataclasses import replace

import numpy as np
import pytest

from lay_control_node.planning.guide_path import guide_path, lay_of, within
from lay_control_node.planning.smoothed_line import PEAK, smoothed_program
from winding_core.fleet_angle import FleetAngleLaw
from winding_core.lay_program import LayProgram

TURN = 2.0 * math.pi
LAG = 9.0
LAW = FleetAngleLaw(advance_per_radian=2.9e-3, free_length=LAG * 0.02, radius=0.02)
TWO_PITCHES = LayProgram(
    theta=TURN * np.array([0.0, 2.0, 4.0, 5.0]), z=np.array([0.0, 0.036, 0.048, 0.03])
)


def test_a_guide_in_step_is_followed_as_the_fleet_angle_law_says():
    theta = np.sort(np.random.default_rng(1).uniform(0.0, 60.0, 500))
    theta[0] = 0.0
    laid = lay_of(theta, LAW.advance_per_radian * theta, LAG)
    # A straight guide is integrated exactly; 500 roundings of z up to 0.2 m add up.
    assert laid == pytest.approx(LAW.z(theta), abs=1e-14)


def test_what_is_missing_at_the_start_decays_with_the_lag():
    theta = np.linspace(0.0, 60.0, 700)
    guide = LAW.advance_per_radian * (theta + LAG)
    off = lay_of(theta, guide, LAG, start=5.0e-3) - LAW.advance_per_radian * theta
    assert off == pytest.approx(5.0e-3 * np.exp(-theta / LAG), abs=1e-14)


def test_lay_behind_a_program_s_guide_is_the_rounded_program():
    theta = np.linspace(0.0, TWO_PITCHES.end, 40_001)
    path, wanted = guide_path(TWO_PITCHES, LAG, 0.4), smoothed_program(TWO_PITCHES, 0.4)
    laid = lay_of(theta, path.at(theta), LAG)
    # Between samples the guide goes straight, off by g'' d^2 / 8 with g'' = 0.6 m/rad^2.
    step = theta[1]
    assert laid == pytest.approx(wanted.at(theta), abs=0.6 * step**2 / 8.0)


def test_a_helix_stays_where_it_is():
    helix = LayProgram(theta=np.array([0.0, 3.0, 20.0]), z=0.003 * np.array([0.0, 3.0, 20.0]))
    theta = np.linspace(-1.0, 25.0, 100)
    assert smoothed_program(helix, 2.0).at(theta) == pytest.approx(0.003 * theta, abs=1e-16)


@pytest.mark.parametrize("width", [0.1, 0.5, 1.5])
def test_a_corner_is_rounded_by_seven_thirtieths_of_slope_change_and_width(width):
    line = smoothed_program(TWO_PITCHES, width)
    expected = PEAK * width * line.bends
    assert line.rounded_by() == pytest.approx(expected, rel=1e-12)
    assert line.at(line.theta) - TWO_PITCHES.z_at(line.theta) == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("order", [0, 1, 2])
def test_each_derivative_is_the_slope_of_the_one_before(order):
    path = guide_path(TWO_PITCHES, LAG, 0.5)
    theta = np.linspace(-3.0, 40.0, 2001)
    d = 1.0e-5
    slope = (path.at(theta + d, order) - path.at(theta - d, order)) / (2.0 * d)
    # The third derivative has corners, at which a central difference is off by d times the fourth;
    # elsewhere roundings of 1e-16 / d count.
    largest = np.abs(path.at(theta, order + 1)).max()
    assert slope == pytest.approx(path.at(theta, order + 1), abs=1e-4 * largest)


def test_an_end_of_travel_holds_the_guide_and_leaves_it_free_inside():
    path = guide_path(TWO_PITCHES, LAG, 0.3)
    held = within(path, -0.01, 0.05)
    theta = np.linspace(0.0, TWO_PITCHES.end, 3000)
    # Straight pieces are put together from differences of them.
    assert held.at(theta).min() >= -0.01 - 1e-12
    assert held.at(theta).max() <= 0.05 + 1e-12
    assert within(path, -1.0, 1.0).at(theta) == pytest.approx(path.at(theta), abs=1e-13)
    free = (path.at(theta) < 0.045) & (theta < 8.0)
    assert free.any()
    assert held.at(theta[free]) == pytest.approx(path.at(theta[free]), abs=1e-12)


def test_corners_that_run_into_each_other_add_up():
    line = smoothed_program(TWO_PITCHES, 3.0)
    alone = [
        replace(line, theta=line.theta[k : k + 1], bends=line.bends[k : k + 1], steps=np.zeros(1))
        for k in range(line.theta.size)
    ]
    theta = np.linspace(0.0, TWO_PITCHES.end, 500)
    together = line.at(theta) - line.unrounded(theta)
    parts = sum(item.at(theta) - item.unrounded(theta) for item in alone)
    assert together == pytest.approx(parts, abs=1e-14)
