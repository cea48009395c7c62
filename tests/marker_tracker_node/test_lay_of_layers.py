"""The lay of three layers between flanges, drawn by the rig, with the truth beside it."""

import math

import numpy as np
import pytest
from marker_film import TURN, pinhole
from test_whole_lay import SMALL

from marker_tracker_node import (
    CameraPose,
    LayConfig,
    LayReading,
    LayTracker,
    Tracker,
    TrackerConfig,
)
from winding_core.cable.condition import Condition
from winding_core.lay.drum_parameters import DrumParameters
from winding_rig_node.camera import Renderer
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


class Film:
    """Three layers between flanges, wound behind a guide that inverts the lag, and drawn."""

    def __init__(self, case, pitch, room, share, turns=math.inf):
        self.what = Condition(case=case).resolved()
        self.cable = self.what.case
        d = self.cable.cable_diameter
        self.drum = DrumParameters(drum_width=room * pitch * d + d, flange=0.02, layers=3)
        full = self.drum.wind(self.cable, pitch * d)
        self.program, lag = full.program(), self.what.free_length / self.cable.centreline_radius
        self.theta = np.arange(0.0, min(self.program.end, turns * TURN), STEP)
        # Corners are rounded as a carriage rounds them.
        wanted = np.convolve(
            np.pad(self.program.z_at(self.theta), 15, mode="edge"), np.hanning(31) / 15.0, "same"
        )
        self.guide = wanted[15:-15] + lag * np.gradient(wanted[15:-15], self.theta)
        # A tracker's configured span is the nominal one.
        hidden = HiddenRig(free_length=share * self.what.free_length, load_share=0.7, drag=0.0)
        self.lay = DrivenLay(self.cable, hidden, full.drum)

    @property
    def truth(self):
        return self.lay.truth(self.lay.wound_angle)

    def frames(self):
        """Yield pictures with the cylinder's angle and the guide's place."""
        renderer, rng, lay = Renderer(SMALL), np.random.default_rng(1), self.lay
        shown = GrowingLay(lay.view(), lifted=True)
        for angle, at in zip(self.theta.tolist(), self.guide.tolist(), strict=True):
            lay.advance(angle, at, self.cable.weight)
            seen = shown.at(at, lay.view())
            yield renderer.render(seen.scene(self.cable, angle), rng), angle, at


def wound(film, lost=None):
    """Measure the lay of a film; frames are lost by the seed `lost`, none without one."""
    what, cable = film.what, film.cable
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
    count = film.theta.size
    kept = np.ones(count, dtype=bool) if lost is None else arriving(count, lost)
    for (frame, angle, at), arrives in zip(film.frames(), kept, strict=True):
        if arrives:
            tracker.take(frame, LayReading(cylinder_angle=angle, guide_z=at))
    return tracker


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
    film = Film(*film, turns)
    tracker = wound(film, lost)
    truth, d = film.truth, tracker.config.diameter
    records = tracker.records()
    records = records[records["theta"] > 0.05]
    assert len(records) > 0.93 * 72 * truth.theta[-1] / TURN
    off = np.abs(records["z"] - np.interp(records["theta"], truth.theta, truth.z))
    # Another turn lies half a pitch away or more.
    assert np.mean(off > 0.3 * d) < 0.02
    assert np.median(off) < 0.02 * d
    lift = np.interp(records["theta"], truth.theta, truth.radius - truth.radius[0])
    seen_high = np.abs(records["lift"] - lift) < 0.3 * d
    raised = film.program.raised_at(records["theta"])
    for layer in np.unique(raised):
        # Heights change at once in climbs at the flanges, a tenth of the turns of a layer.
        assert seen_high[raised == layer].mean() > 0.9
    # What is as high as its layer counts for the controller: none of it is another turn's.
    level = np.abs(records["lift"] - raised) < 0.3 * d
    assert not (off[level] > 0.3 * d).any()
    assert math.isfinite(tracker.report().free_length)


@pytest.mark.slow
@pytest.mark.parametrize(
    "film",
    [(9, 1.03, 3.4, 1.0), (7, 1.1, 3.6, 0.9), (9, 1.2, 5.3, 1.05), (4, 1.05, 6.2, 1.0)],
    ids=["case 9", "case 7", "wide pitch", "case 4"],
)
def test_markers_under_later_layers_are_not_missed(film):
    film = Film(*film)
    tracker, rate = Tracker(TrackerConfig.of(film.what), pinhole(SMALL)), 0.5
    for frame, angle, at in film.frames():
        markers = tracker.track(frame, angle / rate, angle, at)
    report = tracker.report()
    assert not report.contradictions
    assert not report.crossing
    known = np.isfinite(film.lay.marker_theta)
    theta = film.lay.marker_theta
    z = np.interp(theta, film.truth.theta, film.truth.z)
    # What a tracker promises of published values.
    for name, truth in (("theta", theta), ("z", z)):
        wrong = np.abs(markers[name] - truth)[known]
        assert (wrong < 5.0 * markers[f"sigma_{name}"][known]).all(), name
