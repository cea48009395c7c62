"""Every frame meets the encoder reading of its own instant; the camera's clock is measured.

Its histories do not grow with a run.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from marker_film import COUNT, DRIVE, TURN, axes, encoder

from marker_tracker_node import TrackerConfig
from marker_tracker_node.tracking.camera_clock import CameraClock, ClockOffset, ClockSettings
from marker_tracker_node.tracking.encoder_history import KEPT, EncoderHistory
from marker_tracker_node.tracking.synchronised_tracker import Synchroniser

FRAME = np.zeros((2, 2, 3), dtype=np.uint8)
EPOCH = 1.8e9
SHIFT = 0.01
LIMIT = 0.25
# Required of the estimate at the end of the ramp.
REQUIRED = 2.0e-3


def reading(angle):
    return axes(angle, 2.0 * angle)


@pytest.mark.parametrize(
    ("readings", "t", "angle"),
    [
        pytest.param([(0.010, 1.0), (0.012, 2.0)], 0.0115, 1.75, id="between two readings"),
        pytest.param([(1.0, 1.0), (0.5, 9.0)], 1.0, 1.0, id="a stale reading is left out"),
        pytest.param([(1.0, 1.0), (1.5, 1.5)], 1.25, None, id="in a drop-out of the encoder"),
        pytest.param([(1.0, 1.0)], 0.5, None, id="before the first reading"),
    ],
)
def test_a_frame_meets_the_reading_of_its_instant(readings, t, angle):
    pairing = Synchroniser(EncoderHistory(longest_gap=0.02))
    for at, value in readings:
        pairing.add_reading(at, reading(value))
    pairing.add_frame(t, FRAME)
    (pair,) = pairing.ready()
    assert pair.cylinder_angle == (angle if angle is None else pytest.approx(angle))
    assert pair.guide_z == (angle if angle is None else pytest.approx(2.0 * angle))


@pytest.mark.parametrize("ahead", [1, 7])
def test_what_a_frame_is_measured_with_does_not_depend_on_the_encoder_s_lead(ahead):
    pairing = Synchroniser()
    for sample in range(100 + ahead):
        pairing.add_reading(1e-3 * sample, reading(1e-6 * sample**2))
    pairing.add_frame(0.0995, FRAME)
    (pair,) = pairing.ready()
    assert pair.cylinder_angle == pytest.approx(1e-6 * 99.5**2, abs=1e-6)
    assert pairing.history.newest == 0.1
    assert pairing.history.angles(np.array([0.2]))[0] == reading(1e-6 * 100**2).cylinder_angle


def test_frames_do_not_wait_for_a_dead_encoder_forever():
    pairing = Synchroniser(patience=0.1)
    for index in range(5):
        pairing.add_frame(0.05 * index, FRAME)
    # The newest frame is at 0.2 s: frames of 0.1 s and before have waited long enough.
    assert [pair.t for pair in pairing.ready()] == pytest.approx([0.0, 0.05, 0.1])


def test_a_reading_that_was_lost_and_sent_again_is_waited_for():
    pairing = Synchroniser()
    pairing.add_reading(0.0, reading(0.0))
    # What was lost comes 0.1 s later, and some time on its way.
    for frame in range(1, 32):
        pairing.add_frame(0.005 * frame, FRAME)
    assert list(pairing.ready()) == []
    for sample in range(1, 161):
        pairing.add_reading(1e-3 * sample, reading(1e-3 * sample))
    pairs = list(pairing.ready())
    assert [pair.cylinder_angle for pair in pairs] == pytest.approx([pair.t for pair in pairs])
    assert len(pairs) == 31


def test_an_encoder_without_a_camera_fills_no_memory():
    pairing = Synchroniser()
    for sample in range(3 * KEPT):
        pairing.add_reading(sample * 1e-3, reading(0.0))
    assert len(pairing.history) <= 2 * KEPT
    pairing.add_frame(3 * KEPT * 1e-3 - 0.0015, FRAME)
    assert [pair.guide_z for pair in pairing.ready()] == [0.0]


class Bench:
    """An encoder, and a camera that sees P0, from standing to the end of the ramp."""

    def __init__(self, offset, *, fps=200.0, rate=1000.0, loss=0.0, outliers=0.0, rest=0.5, lazy=0):
        self.history = EncoderHistory()
        self.clock = ClockOffset(self.history, 2, LIMIT)
        self.rest = rest
        self.dice = np.random.default_rng(4)
        self.outliers = outliers
        begin = rest - 0.5
        if lazy:
            for t in np.arange(0.0, begin, lazy):
                self.history.add(EPOCH + t, 0.0, 0.0)
                self.see(t, offset)
        frame = 0
        for t in np.arange(begin, rest + DRIVE.ramp_time, 1.0 / rate):
            if self.dice.random() >= loss:
                self.history.add(EPOCH + t, self.angle(t), 0.0)
            while begin + frame / fps <= t:
                self.see(begin + frame / fps, offset)
                frame += 1

    def see(self, t, offset):
        azimuth = self.angle(t) + SHIFT + self.dice.normal(0.0, 1.0e-3)
        if self.dice.random() < self.outliers:
            azimuth += self.dice.choice([-0.1, 0.1])
        self.clock.add(EPOCH + t + offset, np.array([azimuth, math.nan]))

    def angle(self, t):
        return DRIVE.positions(t - self.rest)[0]


@pytest.mark.parametrize("offset", [-0.2, -0.05, -0.005, 0.0, 0.005, 0.05, 0.2])
@pytest.mark.parametrize("fps", [50.0, 200.0])
def test_offset_is_known_by_the_end_of_the_ramp(offset, fps):
    estimate = Bench(offset, fps=fps).clock.estimate
    assert estimate.offset == pytest.approx(offset, abs=REQUIRED)
    assert abs(estimate.offset - offset) < 3.0 * estimate.error < 3.0 * REQUIRED
    # Standing shows where P0 is within a tenth of the noise of one sighting.
    assert estimate.shift == pytest.approx(SHIFT, abs=1.0e-3)


@pytest.mark.parametrize("condition", [{"rate": 40.0, "loss": 0.05}, {"outliers": 0.1}])
def test_a_slow_encoder_and_outliers_do_not_spoil_it(condition):
    estimate = Bench(0.05, fps=50.0, **condition).clock.estimate
    assert estimate.offset == pytest.approx(0.05, abs=REQUIRED)


def test_standing_for_an_hour_gives_no_offset_and_takes_no_memory():
    bench = Bench(-0.05, rest=3600.0, lazy=1.0)
    assert len(bench.history) <= 2 * KEPT
    assert bench.clock.estimate.offset == pytest.approx(-0.05, abs=REQUIRED)


def test_constant_speed_gives_no_offset():
    history = EncoderHistory()
    clock = ClockOffset(history, 1, LIMIT)
    for sample in range(1000):
        history.add(0.001 * sample, 1.74e-3 * sample, 0.0)
        if sample % 5 == 0:
            clock.add(0.001 * sample + 0.1, np.array([1.74e-3 * sample]))
    assert not clock.estimate.known


def test_offsets_that_leave_the_machine_standing_are_not_told_apart():
    # A recording's readings are known ahead of its frames: offsets that bring the first counts of
    # the ramp into the sightings explain their noise a little better.
    history = EncoderHistory(longest_gap=math.inf, complete=True)
    clock = ClockOffset(history, 1, LIMIT)
    for t in np.arange(0.0, 2.0, 0.005):
        history.add(t, encoder(DRIVE.positions(t - 0.6)[0]), 0.0)
    dice = np.random.default_rng(2)
    for t in np.arange(0.0, 0.6, 1.0 / 30.0):
        clock.add(t, np.array([SHIFT + dice.normal(0.0, 1.0e-3)]))
        assert math.isinf(clock.estimate.error)


def test_counts_of_the_encoder_are_no_changes_of_speed():
    history = EncoderHistory()
    clock = ClockOffset(history, 1, LIMIT)
    for sample in range(4000):
        t = 0.005 * sample
        history.add(t, encoder(1.74 * t), 0.0)
        if sample % 6 == 0:
            azimuth = math.remainder(1.74 * (t - 0.1), TURN)
            clock.add(t, np.array([azimuth if abs(azimuth) < 1.0 else math.nan]))
        assert math.isinf(clock.estimate.error)
    # A difference of two counts is off by one at most, over a fifth of a second.
    assert history.speed(19.0) == pytest.approx(1.74, abs=COUNT / 0.2)


@pytest.mark.parametrize("scale", [-0.05, -0.03, 0.0, 0.03, 0.05])
def test_p0_is_found_in_the_next_lap_though_the_encoder_s_scale_is_wrong(scale):
    # A gate finds a band whose place is known to 0.1 rad.
    config = TrackerConfig(
        cylinder_radius=0.03, cable_radius=0.002, marker_spacing=0.1, marker_count=1
    )
    history = EncoderHistory()
    clock = CameraClock(ClockSettings(), config, history)
    found = {0: 0, 1: 0}
    for sample in range(1000):
        t = 0.005 * sample
        true = DRIVE.positions(t)[0]
        history.add(t, (1.0 + scale) * true, 0.0)
        if sample % 6:
            continue
        lap = round(true / TURN)
        place = true - TURN * lap
        angle = (1.0 + scale) * true
        off = angle + clock.lead(t, angle, 0.0) - true
        seen = -0.3 < place < 1.0 and (abs(off) < 0.1 + clock.beside or not sample)
        clock.take(t, np.array([true if seen else math.nan, math.nan]))
        found[lap] += seen
    # Of the 25 frames that have it in sight some pass while the estimate alone is asked.
    assert found[1] > 20


@pytest.mark.parametrize("pause", [0.5, 3.0, 30.0])
def test_a_pause_is_no_wrap_and_a_wrap_is_no_pause(pause):
    for period in (math.inf, 2.0 * math.pi):
        history = EncoderHistory()
        for sample in range(2000):
            t = 0.01 * sample + (pause if sample >= 1000 else 0.0)
            true = 0.0174 * sample
            history.add(t, true if math.isinf(period) else math.fmod(true, period), 0.0)
        assert history.at(19.99 + pause)[0] == pytest.approx(0.0174 * 1999, abs=1e-9)
        assert history.lost_turns == (0 if math.isinf(period) else 5)
