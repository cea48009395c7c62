"""What the elements cost is estimated from two lengths; lift-off is found between nodes."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from cable_fem_node.winding.discretisation import discretisation_error
from cable_fem_node.winding.prediction import PlannedRun
from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.winding_config import WindingConfig
from cable_fem_node.winding.winding_model import lift_off_angle
from winding_core.cases import paper_case


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
    run = PlannedRun(config=WindingConfig(case=paper_case(4)), duration=1.0)
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
    model = RodWinding(WindingConfig(case=paper_case(1)))
    with pytest.raises(ValueError, match="lift-off needs 8 nodes"):
        model.lift_off()
