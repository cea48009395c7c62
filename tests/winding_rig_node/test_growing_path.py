"""A path that is drawn while it is wound is the path that is known once it is wound."""

import numpy as np
import pytest

from winding_core.cases import paper_case
from winding_rig_node.camera import CablePath, CameraConfig, GrowingPath, Renderer, Scene
from winding_rig_node.camera.cable_path import path_crosses, path_height
from winding_rig_node.camera.shown_lay import GrowingLay
from winding_rig_node.lay.driven_lay import DrivenLay
from winding_rig_node.lay.lay_on import HiddenRig

CASE = paper_case(4)


def restless(angle):
    """Where a carriage stands that winds back and forth, over the cylinder's angle [rad]."""
    return 3.0e-3 * angle + 8.0e-3 * np.sin(0.7 * angle)


def wound(seed, *angles):
    """A lay and what a camera has seen of it, wound to one angle after the other [rad]."""
    lay = DrivenLay(CASE, HiddenRig.drawn(np.random.default_rng(seed)))
    shown = GrowingLay(lay.view())
    seen, counted = shown.at(0.0, None), 0
    for angle in angles:
        start, step = lay.contact.angle, 9.0e-3
        parts = max(round(abs(angle - start) / step), 1)
        for k in range(1, parts + 1):
            at = start + (angle - start) * k / parts
            lay.advance(at, restless(at), CASE.weight)
            view = lay.view()
            counted += view.growth.theta.size
            seen = shown.at(0.0, view)
    return lay, seen, counted


ROUTES = [(0.3,), (15.0,), (15.0, 9.0), (15.0, 9.0, 22.0), (8.0, -1.0, 3.0), (4.0, 3.99, 4.1)]


@pytest.mark.parametrize("route", ROUTES)
def test_the_path_is_the_lay_and_the_kernels_find_their_way_in_it(route):
    lay, seen, _ = wound(3, *route)
    path, end = seen.path.table, lay.wound_angle
    theta = np.linspace(0.0, end, 997)
    z = lay.z_at(theta)
    np.testing.assert_allclose(seen.path.height(theta), z, rtol=0, atol=1.0e-12)
    found = [path_height(path.theta, path.z, path.lift, path.first, at)[0] for at in theta]
    np.testing.assert_allclose(found, z, rtol=0, atol=1.0e-12)
    # No part of the path is left out where it crosses a height.
    for start in theta[:-30:29]:
        inside = (theta >= start) & (theta <= start + 0.2)
        low, high = z[inside].min(), z[inside].max()
        assert path_crosses(path, start, start + 0.2, low, low)
        assert path_crosses(path, start, start + 0.2, high, high)


def test_it_says_where_nothing_lies():
    _, seen, _ = wound(3, 30.0)
    path = seen.path.table
    assert not path_crosses(path, 2.0, 3.0, 0.2, 0.3)
    # Later turns lie elsewhere than the first one.
    assert not path_crosses(path, 0.0, 1.0, path.z.max(), path.z.max())


@pytest.mark.parametrize("route", ROUTES)
def test_it_is_drawn_as_a_path_that_is_known(route):
    lay, seen, _ = wound(4, *route)
    table = seen.path.table
    known = CablePath(theta=table.theta, z=table.z)
    pictures = []
    for path in (seen.path, known):
        made = Scene(
            cylinder_radius=CASE.cylinder_radius,
            cable_radius=CASE.cable_radius,
            cylinder_angle=lay.wound_angle,
            path=path,
            marker_theta=seen.marker_theta,
            guide_z=seen.guide_z,
            free_length=seen.free_length,
        )
        pictures.append(Renderer(CameraConfig()).render(made, np.random.default_rng(0)))
    np.testing.assert_array_equal(*pictures)


def test_the_lay_goes_on_beyond_the_contact_line_in_its_direction():
    lay, seen, _ = wound(3, 15.0)
    ahead = lay.wound_angle + 0.01
    # The direction is that since the last kept point, of a lay that bends by 1 mm/rad^2.
    expected = lay.z + 0.01 * lay.contact.slope
    assert seen.path.height(np.array(ahead)) == pytest.approx(expected, abs=0.5e-6)


def test_every_point_is_told_once():
    lay, _, counted = wound(3, 40.0)
    # P0 was viewed before the first step.
    assert counted == lay.path.theta.size - 1


def test_points_are_kept_beyond_the_room_that_was_made_for_them():
    path = GrowingPath()
    theta = 0.02 * np.arange(20_000)
    path.grow(0, theta[:1], theta[:1])
    path.end(0.0, 0.0, 0.0)
    path.grow(1, theta[1:], 1.0e-3 * theta[1:])
    path.end(400.0, 0.4, 1.0e-3)
    at = np.array([0.5, 399.5, 399.99])
    np.testing.assert_allclose(path.height(at), 1.0e-3 * at, rtol=1.0e-9)
    assert path_crosses(path.table, 390.0, 391.0, 0.3905, 0.3906)


def test_more_than_there_is_cannot_be_kept():
    with pytest.raises(ValueError, match="a path of 0 points cannot keep 3"):
        GrowingPath().grow(3, np.empty(0), np.empty(0))
