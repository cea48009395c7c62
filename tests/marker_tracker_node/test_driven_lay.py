"""A lay that is wound while it is filmed, under commands, is measured within its deviations."""

import math
from functools import partial

import numpy as np
import pytest
from marker_film import DRIVE, FREE_LENGTH, encoder

from winding_core.cable.cases import paper_case
from winding_core.markers import MarkerFlag
from winding_rig_node.camera import CameraConfig, Renderer, Scene
from winding_rig_node.camera.shown_lay import GrowingLay
from winding_rig_node.lay.driven_lay import DrivenLay
from winding_rig_node.lay.lay_on import HiddenRig

# Every eightieth sample of the machine is a frame.
PERIOD = 80


def swaying(angle, carriage):
    """The feed of the programme with a sway of 3 mm, as a commander may ask for."""
    return carriage + 3.0e-3 * math.sin(angle / 3.0)


def leading(lag, angle, carriage):
    """A guide that goes ahead by its lag within a turn, as a controller of an even helix has it."""
    return carriage + DRIVE.advance_per_radian * lag * -math.expm1(-angle / 2.0)


def pulled(angle, weight):
    """A pull that a commander raises by a fifth after two turns."""
    return weight * (1.2 if angle > 4.0 * math.pi else 1.0)


def wound(case, seed, guide, samples=20_001, period=PERIOD):
    """Wind a hidden rig; yield sample, encoder reading, carriage, lay and picture of each frame."""
    hidden = HiddenRig.drawn(np.random.default_rng(seed))
    lay = DrivenLay(case, hidden)
    shown = GrowingLay(lay.view())
    renderer, rng = Renderer(CameraConfig()), np.random.default_rng(seed)
    for sample in range(samples):
        angle, feed = DRIVE.positions(1.0e-3 * sample)
        carriage = guide(angle, feed)
        lay.advance(angle, carriage, pulled(angle, case.weight))
        if sample % period:
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
        picture = partial(renderer.render, scene, rng)
        yield 1.0e-3 * sample, encoder(angle), carriage, lay, picture


def deviations(tracker, lay):
    """Return errors of theta and z of the landed markers, in their stated deviations."""
    landed = np.flatnonzero(np.isfinite(lay.marker_theta))[1:]
    assert landed.size >= 3
    found = tracker.estimates()[landed]
    assert not (found["flags"] & MarkerFlag.NOT_WOUND).any()
    off_theta = (found["theta"] - lay.marker_theta[landed]) / found["sigma_theta"]
    off_z = (found["z"] - lay.z_at(lay.marker_theta[landed])) / found["sigma_z"]
    return np.concatenate([off_theta, off_z])


@pytest.mark.parametrize(("number", "seed"), [(4, 11), (9, 12)])
def test_a_driven_lay_is_measured_within_the_stated_deviations(paper_film, number, seed):
    tracker = paper_film(number).tracker()
    for t, reading, carriage, lay, picture in wound(paper_case(number), seed, swaying):  # noqa: B007
        tracker.track(picture(), t, reading, carriage)
    # Of 16 numbers with normal errors one is beyond 4 deviations once in a thousand tests.
    assert np.abs(deviations(tracker, lay)).max() < 4.0


def taken_up(film, number, seed, since, *length):
    """Return the deviations of a tracker that joins a run of a leading guide at a time [s]."""
    case, before, tracker = paper_case(number), [], None
    guide = partial(leading, FREE_LENGTH / case.centreline_radius)
    for t, reading, carriage, lay, picture in wound(case, seed, guide, *length):  # noqa: B007
        if t < since:
            before.append((t, reading, carriage))
            continue
        tracker = tracker or film.tracker(motion_before=np.transpose(before))
        tracker.track(picture(), t, reading, carriage)
    return deviations(tracker, lay)


@pytest.mark.slow
@pytest.mark.parametrize(("number", "seed", "since"), [(4, 11, 8.0), (1, 13, 6.0), (12, 14, 11.0)])
def test_a_tracker_that_takes_up_a_driven_run_numbers_its_markers(paper_film, number, seed, since):
    # Two passes of P0 show its colour, a third its place, two more those of the others.
    off = taken_up(paper_film(number), number, seed, since, 30_001)
    assert np.abs(off).max() < 4.0


@pytest.mark.slow
@pytest.mark.parametrize("since", [0.5, 0.9])
def test_a_tracker_that_begins_anew_knows_the_way_of_the_guide(paper_film, since):
    # P0 has hardly been seen when the tracker begins: it is proven, and the pose turned, as it
    # passes again, and what was measured before is void.
    assert np.abs(taken_up(paper_film(4), 4, 11, since, 13_001, 20)).max() < 4.0
