"""The whole lay without markers: known lays, drawn by the rig's renderer, measured again."""

from dataclasses import replace

import numpy as np
import pytest
from known_lay import FREE_LENGTH, SMALL, TURN, KnownLay, pinhole, rms

from marker_tracker_node import CameraPose, LayReading, LayTracker, PoseBelief
from winding_rig_node.camera import CameraConfig, Light, SensorNoise

LARGE = SMALL.full_frame()

# Cylinders of 20 to 100 mm, cables of 2 to 6 mm, touching to three diameters apart [mm].
LAYS = [(10, 1, 2.02), (25, 1, 3.0), (25, 2, 4.04), (30, 2, 8.0), (50, 3, 6.1), (50, 3, 18.0)]


@pytest.mark.slow
@pytest.mark.parametrize(("radius", "cable", "pitch"), LAYS)
def test_every_turn_is_measured_in_the_small_window(radius, cable, pitch):
    lay = KnownLay(radius * 1e-3, cable * 1e-3, pitch * 1e-3)
    tracker, spans = lay.measured()
    records = tracker.records()
    errors, _ = lay.errors(records)
    # What has passed the rows up to 0.4 to 0.7 rad, of four turns.
    assert len(errors) >= 0.93 * 4 * 72
    # 0.1 mm is asked for; 0.4 px of the window.
    assert rms(errors) < 1.0e-4
    # 2 mrad are asked for.
    assert rms(spans) < 2.0e-3


@pytest.mark.slow
@pytest.mark.parametrize(("radius", "cable", "pitch"), LAYS[2:5])
def test_every_turn_is_measured_in_the_whole_picture(radius, cable, pitch):
    lay = KnownLay(radius * 1e-3, cable * 1e-3, pitch * 1e-3, turns=3)
    tracker, spans = lay.measured(LARGE, step=0.16)
    errors, _ = lay.errors(tracker.records())
    # 0.03 mm and 1 mrad are asked for.
    assert rms(errors) < 3.0e-5
    assert rms(spans) < 1.0e-3


@pytest.mark.slow
def test_errors_are_as_large_as_told():
    lay = KnownLay(0.025, 0.002, 0.0045, turns=3)
    errors, sigma = lay.errors(lay.measured()[0].records())
    # One standard deviation holds the systematic part too: within a factor of two of what happens.
    assert 0.5 < rms(errors / sigma) < 2.0


def posed(dice, belief):
    """Return a camera that stands where the belief allows, somewhere."""
    return replace(
        SMALL,
        position=tuple(np.add(SMALL.position, dice.normal(0.0, belief.position, 3))),
        tilt=tuple(dice.normal(0.0, belief.tilt, 3)),
    )


def scores(seed, belief):
    """Return errors of z over what is told of them, the camera not quite where it is thought."""
    dice = np.random.default_rng(seed)
    radius, cable = dice.uniform(0.015, 0.05), dice.uniform(0.001, 0.003)
    lay = KnownLay(radius, cable, 2.0 * cable * dice.uniform(1.02, 2.5), turns=2)
    tracker, _ = lay.measured(
        posed(dice, belief), 0.12, seed, pose=CameraPose(position=SMALL.position), belief=belief
    )
    errors, sigma = lay.errors(tracker.records())
    return errors / sigma


@pytest.mark.campaign
@pytest.mark.parametrize(
    "belief",
    [PoseBelief(position=0.5e-3, tilt=0.5e-3), PoseBelief(position=0.0, tilt=2.0e-3)],
    ids=["position and tilt", "tilt"],
)
def test_errors_of_a_camera_that_stands_elsewhere_are_as_large_as_told(belief):
    # One number per lay: errors along one lay come from one pose.
    lays = [rms(scores(seed, belief)) for seed in range(2000, 2060)]
    # The mean square of 60 draws of one number is known to 18 %, and there are one or two of them.
    assert 0.8 < rms(lays) < 1.3


@pytest.mark.slow
def test_free_length_is_known_before_the_first_marker_lands():
    # The paper's drive and span: the guide leads by ever more.
    lay = KnownLay(0.015, 0.002, 0.01806, turns=2)
    lag = FREE_LENGTH / lay.rho
    advance = lay.pitch / TURN
    wound = np.maximum(lay.theta, 0.0)
    lay.z = advance * (wound + lag * np.expm1(-wound / lag))
    lay.guide = advance * wound
    tracker, _ = lay.measured(until=0.98 * TURN)
    report = tracker.report()
    assert report.free_length == pytest.approx(FREE_LENGTH, abs=2.0e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    "camera",
    [
        CameraConfig(light=Light(direction=(1.0, -0.3, 0.3))),
        CameraConfig(light=Light(highlight=0.5, gloss=60.0)),
        CameraConfig(light=Light(gain=0.5, falloff=0.5)),
        CameraConfig(noise=SensorNoise(read=6.0, shot=0.1)),
    ],
    ids=["from the side", "highlight", "dim and uneven", "noise"],
)
def test_light_and_noise_do_not_matter(camera):
    lay = KnownLay(0.025, 0.002, 0.006, turns=2)
    errors, _ = lay.errors(lay.measured(camera)[0].records())
    assert len(errors) >= 0.88 * 2 * 72
    assert rms(errors) < 1.0e-4


def test_nothing_is_measured_without_cable():
    lay = KnownLay(0.025, 0.002, 0.006, turns=2)
    tracker = LayTracker(lay.config(SMALL), pinhole(SMALL))
    blank = np.full((96, 640, 3), 90, dtype=np.uint8)
    assert tracker.take(blank, LayReading(cylinder_angle=7.0, guide_z=0.02)) == 0
    assert len(tracker.records()) == 0


@pytest.mark.slow
def test_a_tracker_that_joins_a_run_finds_the_turns_that_are_there():
    lay = KnownLay(0.025, 0.002, 0.008, turns=4)
    tracker = LayTracker(lay.config(SMALL), pinhole(SMALL))
    for frame, reading in lay.frames(SMALL, np.arange(2.5 * TURN, 3.7 * TURN, 0.08), 1):
        tracker.take(frame, reading)
    records = tracker.records()
    errors, _ = lay.errors(records)
    # Everything wound but the last 0.7 rad, which have not passed all rows.
    assert len(errors) >= 0.93 * 3.6 * 72
    assert rms(errors) < 1.0e-4
