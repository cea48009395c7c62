"""How cable lands and lifts off, and what the length of the elements costs."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from random_conditions import condition
from rods import CONFIG, case_of, follow

from cable_fem_node.winding.discretisation import discretisation_error
from cable_fem_node.winding.prediction import PlannedRun
from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.winding_config import WindingConfig
from cable_fem_node.winding.winding_model import lift_off_angle
from winding_core.cable.cases import Case, Material, paper_case
from winding_core.machine.drive import DriveProfile


def stiff_run(bending_share: float, segment: float) -> PlannedRun:
    """Return a run of a 4 mm cable on 60 mm whose bending takes a share of its tension."""
    young, radius = 2.5e6, 32.0e-3
    bending = young * math.pi * 4.0e-3**4 / 64.0
    case = Case(
        cylinder_diameter=60.0e-3,
        cable_diameter=4.0e-3,
        weight=0.5 * bending / (bending_share * radius**2),
        material=Material(young=young),
        marker_count=1,
        marker_spacing=0.3,
    )
    # Slow enough for the tensions of stiff cables, a few hundredths of a newton.
    drive = DriveProfile(angular_speed=0.6, feed_speed=0.5e-3)
    config = WindingConfig(case=case, law="linear", segment_length=segment)
    return PlannedRun(config=config, drive=drive, duration=8.0)


@pytest.mark.parametrize("bending_share", [0.05, 0.2])
def test_bending_takes_its_share_of_the_tension(bending_share):
    run = stiff_run(bending_share, 5.0e-3)
    result = run.wind(whole=False)
    wound = result.cable["tension"][2 : result.arc.size - 2].mean()
    share = 1.0 - wound / run.config.resolved.tension
    # Measured 0.048 and 0.196, from 0.050 and 0.200 in the limit of short elements. Elements that
    # are held where they land lose 0.035 and 0.165.
    assert share == pytest.approx(run.config.resolved.bending_share, rel=0.07)


@pytest.mark.parametrize("case", [1, 4])
def test_cable_does_not_bounce_where_it_lands(case):
    drive = DriveProfile()
    model = follow(RodWinding(case_of(case, rests=False)), 2.0, 5.0e-3)
    laid, landings = model.wound_path()[0].size, 0
    while landings < 2:
        t = model.time + model.step_limit
        model.advance_to(t, drive.reading_at(t))
        before, laid = laid, model.wound_path()[0].size
        assert laid in (before, before + 1)
        landings += laid - before


# A light cable that bounced until its energy balance was open by 1.5 %, and one that did not. The
# bar is the paper's conditions'; measured 0.003.
@pytest.mark.parametrize("seed", [1, 26])
def test_landing_neither_makes_nor_takes_energy(seed):
    config, drive = condition(seed)
    run = PlannedRun(config=config, drive=drive, duration=3.0)
    assert run.wind(whole=False).energy.balance_pct < 0.1


def test_strain_of_a_stiff_cable_does_not_hang_on_its_elements():
    # What bending takes is 5 % of the tension. Measured 8e-4, with elements that are held where
    # they land 6e-3.
    one, other = (stiff_run(0.05, length).wind(whole=False) for length in (5.0e-3, 2.5e-3))
    assert one.stretch - 1.0 == pytest.approx(other.stretch - 1.0, rel=2.0e-3)


@pytest.mark.slow
def test_the_estimate_covers_what_much_shorter_elements_change():
    case = dataclasses.replace(paper_case(6), marker_spacing=0.04, marker_count=1)
    run = PlannedRun(config=WindingConfig(case=case), duration=3.0)
    result = run.wind(whole=False)
    estimate = discretisation_error(run, result)
    quarter = dataclasses.replace(run.config, segment_length=0.25 * estimate.segment)
    shorter = dataclasses.replace(run, config=quarter).wind(whole=False)
    left = float(result.markers["s"][1] - shorter.markers["s"][1])
    assert estimate.finer_segment == 0.5 * estimate.segment
    # A quarter is not the limit: three quarters of a first-order error, 15/16 of a second-order
    # one, of which the estimate is 3/2.
    assert 0.5 * abs(left) < abs(estimate.s[0]) < 2.5 * abs(left)
    assert math.copysign(1.0, estimate.s[0]) == math.copysign(1.0, left)


def test_markers_that_are_not_wound_have_no_estimate():
    run = PlannedRun(config=CONFIG, duration=1.0)
    estimate = discretisation_error(run, run.wind(whole=False))
    assert np.isnan(estimate.s).all()
    assert np.isnan(estimate.theta).all()


def test_lift_off_of_a_known_moment_lies_between_the_nodes():
    # A circle up to azimuth 0.3, then a curvature that decays as a stiff cable's does.
    radius, h, edge = 1.0, 0.05, 0.3
    arc = h * np.arange(60)
    start = edge + 1.02
    bend = np.where(arc < start - edge, 1.0, np.exp(-(arc - (start - edge)) / 0.3)) * h
    heading = start - np.concatenate([[0.5 * h], 0.5 * h + np.cumsum(bend[1:])])
    x = radius * math.cos(start) + np.concatenate([[0.0], np.cumsum(h * np.sin(heading))])
    y = radius * math.sin(start) - np.concatenate([[0.0], np.cumsum(h * np.cos(heading))])
    laid = int(np.count_nonzero(arc < start - edge))
    found = lift_off_angle(np.stack([x, y]), np.full(60, h), laid)
    # Chords of 0.05 rad are 5e-5 rad off their arcs each.
    assert found == pytest.approx(edge, abs=2.0e-3)


def test_a_limp_cable_has_no_moment_to_follow():
    model = RodWinding(case_of(1))
    with pytest.raises(ValueError, match="lift-off needs 8 nodes"):
        model.lift_off()
