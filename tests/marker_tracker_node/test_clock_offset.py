"""The camera's clock against the encoder's, from azimuths without pictures."""

import math

import numpy as np
import pytest

from marker_tracker_node.tracking.checks.camera_clock import ClockOffset
from marker_tracker_node.tracking.encoder_history import KEPT, EncoderHistory
from winding_core.drive import DriveProfile

DRIVE = DriveProfile()
EPOCH = 1.8e9
SHIFT = 0.01
LIMIT = 0.25
# Required of the estimate at the end of the ramp.
REQUIRED = 2.0e-3


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
    # Standing says where P0 is within a tenth of the noise of one sighting.
    assert estimate.shift == pytest.approx(SHIFT, abs=1.0e-3)


@pytest.mark.parametrize("condition", [{"rate": 40.0, "loss": 0.05}, {"outliers": 0.1}])
def test_a_slow_encoder_and_outliers_do_not_spoil_it(condition):
    estimate = Bench(0.05, fps=50.0, **condition).clock.estimate
    assert estimate.offset == pytest.approx(0.05, abs=REQUIRED)


def test_standing_for_an_hour_tells_nothing_and_takes_no_memory():
    bench = Bench(-0.05, rest=3600.0, lazy=1.0)
    assert len(bench.history) <= 2 * KEPT
    # What a ramp leaves; the hour before it is one mean.
    assert np.isfinite(bench.clock._t).sum() < 200
    assert bench.clock.estimate.offset == pytest.approx(-0.05, abs=REQUIRED)


def test_constant_speed_tells_nothing():
    history = EncoderHistory()
    clock = ClockOffset(history, 1, LIMIT)
    for sample in range(1000):
        history.add(0.001 * sample, 1.74e-3 * sample, 0.0)
        if sample % 5 == 0:
            clock.add(0.001 * sample + 0.1, np.array([1.74e-3 * sample]))
    assert not clock.estimate.known


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
