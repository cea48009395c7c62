"""The true lay behind the camera's pictures."""

import numpy as np
import pytest

from winding_core.cases import Case, paper_case
from winding_core.drive import DriveProfile
from winding_core.fleet_angle import PAPER_FREE_LENGTH, FleetAngleLaw
from winding_core.helix import curve_length
from winding_core.published import published_markers
from winding_rig_node.lay.known_lay import (
    HiddenCable,
    published_lay,
    simulated_lay,
)
from winding_rig_node.lay.lay_on import neo_hookean_stretch

END = 33.93


def test_published_lay_passes_through_every_measured_marker() -> None:
    offenders = []
    for number in range(1, 13):
        lay = published_lay(paper_case(number), DriveProfile(), PAPER_FREE_LENGTH, END)
        for marker in published_markers(number):
            theta = lay.marker_theta[marker.marker]
            z = np.interp(theta, lay.path_theta, lay.path_z)
            measured = marker.experiment
            if measured is None:
                passes = bool(np.isnan(theta))
            else:
                passes = theta == measured.theta and abs(z - measured.z) < 1e-12
            if not passes:
                offenders.append((number, marker.marker))
    assert offenders == []


def test_simulated_lay_without_load_winds_the_undeformed_cable() -> None:
    case = paper_case(4)
    hidden = HiddenCable(free_length=0.2, load_factor=1e-9, drag=0.0)
    lay = simulated_lay(case, DriveProfile(), hidden, END)
    z = np.interp(lay.marker_theta[1], lay.path_theta, lay.path_z)
    length = curve_length(case.centreline_radius, float(lay.marker_theta[1]), float(z))
    # S_1 is the straight helix to a path that curves a little: shorter by under 0.1 %.
    assert length == pytest.approx(case.marker_spacing, rel=1e-3)


def test_simulated_lay_follows_the_fleet_angle_law() -> None:
    case, drive = paper_case(9), DriveProfile()
    hidden = HiddenCable.drawn(np.random.default_rng(3))
    lay = simulated_lay(case, drive, hidden, END)
    law = FleetAngleLaw(
        advance_per_radian=drive.advance_per_radian,
        free_length=hidden.free_length,
        radius=case.centreline_radius,
    )
    np.testing.assert_allclose(lay.path_z, law.z(lay.path_theta), atol=1e-12)


def test_more_weight_winds_longer_lengths() -> None:
    hidden = HiddenCable(free_length=0.2, load_factor=0.7, drag=0.1)
    light = simulated_lay(paper_case(3), DriveProfile(), hidden, END)
    heavy = simulated_lay(paper_case(4), DriveProfile(), hidden, END)
    assert (heavy.marker_theta[1:] > light.marker_theta[1:]).all()


def test_neo_hookean_stretch_balances_its_load() -> None:
    loads = np.array([0.0, 0.06, 0.24, 0.48])
    stretch = np.array([neo_hookean_stretch(load) for load in loads])
    np.testing.assert_allclose((stretch - stretch**-2) / 3.0, loads, rtol=0, atol=1e-9)


def test_published_lay_of_an_unpublished_condition_is_refused() -> None:
    own = Case(cylinder_diameter=0.04, cable_diameter=0.003, weight=2.0, marker_spacing=0.1)
    with pytest.raises(ValueError, match="as the paper measured it"):
        published_lay(own, DriveProfile(), PAPER_FREE_LENGTH, END)
