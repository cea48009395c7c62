"""The lay of three layers between flanges, drawn by the rig, with the truth beside it."""

import math

import numpy as np
import pytest
from marker_film import TURN, pinhole
from test_whole_lay import SMALL

from marker_tracker_node import CameraPose, LayConfig, LayReading, LayTracker
from winding_core.cable.condition import Condition
from winding_core.lay.drum_parameters import DrumParameters
from winding_rig_node.camera import Renderer, Scene
from winding_rig_node.camera.shown_lay import GrowingLay
from winding_rig_node.lay.driven_lay import DrivenLay
from winding_rig_node.lay.lay_on import HiddenRig

STEP = 0.02


def arriving(count, seed):
    """Return which of so many frames arrive; every now and then up to half a radian is lost."""
    rng, kept, at = np.random.default_rng(seed), np.zeros(count, dtype=bool), 0
    while at < count:
        end = at + int(rng.integers(1, 60))
        kept[at:end] = True
        at = end + int(rng.uniform(0.0, 0.5) / STEP)
    return kept


def wound(case, pitch, room, share, lost=None, turns=math.inf):
    """Wind three layers behind a guide that inverts the lag; return tracker, lay and program.

    Frames are lost by the seed `lost`; none without one.
    """
    what = Condition(case=case).resolved()
    cable, d = what.case, what.case.cable_diameter
    drum = DrumParameters(drum_width=room * pitch * d + d, flange=0.02, layers=3)
    full = drum.wind(cable, pitch * d)
    program, lag = full.program(), what.free_length / cable.centreline_radius
    theta = np.arange(0.0, min(program.end, turns * TURN), STEP)
    # Corners are rounded as a carriage rounds them.
    wanted = np.convolve(
        np.pad(program.z_at(theta), 15, mode="edge"), np.hanning(31) / 15.0, "same"
    )
    guide = wanted[15:-15] + lag * np.gradient(wanted[15:-15], theta)
    # The tracker's configured span is the nominal one.
    hidden = HiddenRig(free_length=share * what.free_length, load_share=0.7, drag=0.0)
    lay, renderer, rng = (
        DrivenLay(cable, hidden, full.drum),
        Renderer(SMALL),
        np.random.default_rng(1),
    )
    shown = GrowingLay(lay.view(), lifted=True)
    tracker = LayTracker(
        LayConfig(
            cylinder_radius=cable.cylinder_radius,
            cable_radius=cable.cable_radius,
            # The drive programme's, which is not the drum's.
            advance_per_radian=what.drive.advance_per_radian,
            free_length=what.free_length,
            pose=CameraPose(position=SMALL.position),
        ),
        pinhole(SMALL),
    )
    kept = np.ones(theta.size, dtype=bool) if lost is None else arriving(theta.size, lost)
    for angle, at, arrives in zip(theta.tolist(), guide.tolist(), kept, strict=True):
        lay.advance(angle, at, cable.weight)
        seen = shown.at(at, lay.view())
        scene = Scene(
            cylinder_radius=cable.cylinder_radius,
            cable_radius=cable.cable_radius,
            cylinder_angle=angle,
            path=seen.path,
            marker_theta=seen.marker_theta,
            guide_z=seen.guide_z,
            free_length=seen.free_length,
        )
        frame = renderer.render(scene, rng)
        if arrives:
            tracker.take(frame, LayReading(cylinder_angle=angle, guide_z=at))
    return tracker, lay.truth(lay.wound_angle), program


@pytest.mark.slow
@pytest.mark.parametrize(
    ("film", "lost", "turns"),
    [
        ((9, 1.03, 3.4, 1.0), None, math.inf),
        ((7, 1.1, 3.6, 0.9), None, math.inf),
        # The turn before was taken for the newest one from 11.9 turns on.
        ((9, 1.025, 5.34, 1.05), 1, 13.4),
    ],
    ids=["case 9", "case 7", "frames lost"],
)
def test_turns_of_every_layer_are_told_from_their_neighbours(film, lost, turns):
    tracker, truth, program = wound(*film, lost, turns)
    d = tracker.config.diameter
    records = tracker.records()
    records = records[records["theta"] > 0.05]
    assert len(records) > 0.93 * 72 * truth.theta[-1] / TURN
    off = np.abs(records["z"] - np.interp(records["theta"], truth.theta, truth.z))
    # Another turn lies half a pitch away or more.
    assert np.mean(off > 0.3 * d) < 0.02
    assert np.median(off) < 0.02 * d
    lift = np.interp(records["theta"], truth.theta, truth.radius - truth.radius[0])
    seen_high = np.abs(records["lift"] - lift) < 0.3 * d
    raised = program.raised_at(records["theta"])
    for layer in np.unique(raised):
        # Heights change at once in climbs at the flanges, a tenth of the turns of a layer.
        assert seen_high[raised == layer].mean() > 0.9
    # What is as high as its layer counts for the controller: none of it is another turn's.
    level = np.abs(records["lift"] - raised) < 0.3 * d
    assert not (off[level] > 0.3 * d).any()
    assert math.isfinite(tracker.report().free_length)
