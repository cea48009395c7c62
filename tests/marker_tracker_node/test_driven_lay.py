"""A lay that is wound while it is filmed, under commands, is measured within its deviations."""

import math

import numpy as np
import pytest

from winding_core.cases import paper_case
from winding_core.drive import DriveProfile
from winding_core.markers import MarkerFlag
from winding_rig_node.camera import CameraConfig, Renderer, Scene
from winding_rig_node.camera.shown_lay import GrowingLay
from winding_rig_node.machine.driven_lay import DrivenLay
from winding_rig_node.machine.hidden_rig import HiddenRig

DRIVE = DriveProfile()
COUNT = 2.0 * math.pi / 8192
# Every eightieth sample of the machine is a frame.
PERIOD = 80


def swaying(angle, carriage):
    """The feed of the programme with a sway of 3 mm, as a commander may ask for."""
    return carriage + 3.0e-3 * math.sin(angle / 3.0)


def pulled(angle, weight):
    """A pull that a commander raises by a fifth after two turns."""
    return weight * (1.2 if angle > 4.0 * math.pi else 1.0)


@pytest.mark.parametrize(("number", "seed"), [(4, 11), (9, 12)])
def test_a_driven_lay_is_measured_within_the_stated_deviations(paper_film, number, seed):
    case = paper_case(number)
    lay = DrivenLay(case, HiddenRig.drawn(np.random.default_rng(seed)))
    shown = GrowingLay(lay.view())
    camera = CameraConfig()
    renderer, rng = Renderer(camera), np.random.default_rng(seed)
    tracker = paper_film(number).tracker()
    for sample in range(20_001):
        angle, feed = DRIVE.positions(1.0e-3 * sample)
        carriage = swaying(angle, feed)
        lay.advance(angle, carriage, pulled(angle, case.weight))
        if sample % PERIOD:
            continue
        seen = shown.at(carriage, lay.view())
        scene = Scene(
            cylinder_radius=case.cylinder_radius,
            cable_radius=case.cable_radius,
            cylinder_angle=angle,
            path=seen.path,
            marker_theta=seen.marker_theta,
            guide_z=seen.guide_z,
            free_length=seen.free_length,
        )
        tracker.track(
            renderer.render(scene, rng), 1.0e-3 * sample, COUNT * round(angle / COUNT), carriage
        )
    records = tracker.estimates()
    landed = np.flatnonzero(np.isfinite(lay.marker_theta))[1:]
    assert landed.size >= 3
    found = records[landed]
    assert not (found["flags"] & MarkerFlag.NOT_WOUND).any()
    off_theta = (found["theta"] - lay.marker_theta[landed]) / found["sigma_theta"]
    off_z = (found["z"] - lay.z_at(lay.marker_theta[landed])) / found["sigma_z"]
    # Of 16 numbers with normal errors one is beyond 4 deviations once in a thousand tests.
    assert np.abs(off_theta).max() < 4.0
    assert np.abs(off_z).max() < 4.0
