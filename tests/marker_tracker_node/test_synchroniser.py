"""Every frame meets the encoder reading of its own instant."""

import numpy as np
import pytest

from marker_tracker_node.tracking.encoder_history import KEPT, EncoderHistory
from marker_tracker_node.tracking.synchronised_tracker import Synchroniser
from winding_core.readings import AxisReading

FRAME = np.zeros((2, 2, 3), dtype=np.uint8)


def reading(angle: float) -> AxisReading:
    return AxisReading(
        cylinder_angle=angle, angular_speed=1.0, carriage_position=2.0 * angle, feed_speed=2.0
    )


def test_frame_waits_for_the_encoder() -> None:
    pairing = Synchroniser()
    pairing.add_reading(0.0, reading(0.0))
    pairing.add_frame(0.005, FRAME)
    assert list(pairing.ready()) == []
    pairing.add_reading(0.005, reading(0.005))
    assert [pair.t for pair in pairing.ready()] == [0.005]


def test_reading_is_interpolated_to_the_frame() -> None:
    pairing = Synchroniser()
    pairing.add_reading(0.010, reading(1.0))
    pairing.add_reading(0.012, reading(2.0))
    pairing.add_frame(0.0115, FRAME)
    (pair,) = pairing.ready()
    assert pair.cylinder_angle == pytest.approx(1.75)
    assert pair.guide_z == pytest.approx(3.5)


@pytest.mark.parametrize("ahead", [1, 7])
def test_what_a_frame_is_measured_with_does_not_depend_on_the_encoder_s_lead(ahead: int) -> None:
    pairing = Synchroniser()
    for sample in range(100 + ahead):
        pairing.add_reading(1e-3 * sample, reading(1e-6 * sample**2))
    pairing.add_frame(0.0995, FRAME)
    (pair,) = pairing.ready()
    assert pair.cylinder_angle == pytest.approx(1e-6 * 99.5**2, abs=1e-6)
    assert pairing.history.newest == 0.1
    assert pairing.history.angles(np.array([0.2]))[0] == reading(1e-6 * 100**2).cylinder_angle


def test_frame_in_an_encoder_drop_out_goes_without_a_reading() -> None:
    pairing = Synchroniser(EncoderHistory(longest_gap=0.02))
    pairing.add_reading(1.0, reading(1.0))
    pairing.add_frame(1.25, FRAME)
    pairing.add_reading(1.5, reading(1.5))
    (pair,) = pairing.ready()
    assert pair.cylinder_angle is None


def test_frames_do_not_wait_for_a_dead_encoder_forever() -> None:
    pairing = Synchroniser(patience=0.1)
    for index in range(5):
        pairing.add_frame(0.05 * index, FRAME)
    # The newest frame is at 0.2 s: frames of 0.1 s and before have waited long enough.
    assert [pair.t for pair in pairing.ready()] == pytest.approx([0.0, 0.05, 0.1])


def test_stale_reading_is_left_out() -> None:
    pairing = Synchroniser()
    pairing.add_reading(1.0, reading(1.0))
    pairing.add_reading(0.5, reading(9.0))
    pairing.add_frame(1.0, FRAME)
    (pair,) = pairing.ready()
    assert pair.cylinder_angle == 1.0


def test_frame_before_the_first_reading_goes_without() -> None:
    pairing = Synchroniser()
    pairing.add_reading(1.0, reading(1.0))
    pairing.add_frame(0.5, FRAME)
    (pair,) = pairing.ready()
    assert pair.cylinder_angle is None


def test_an_encoder_without_a_camera_fills_no_memory() -> None:
    pairing = Synchroniser()
    for sample in range(3 * KEPT):
        pairing.add_reading(sample * 1e-3, reading(0.0))
    assert len(pairing.history) <= 2 * KEPT
    pairing.add_frame(3 * KEPT * 1e-3 - 0.0015, FRAME)
    assert [pair.guide_z for pair in pairing.ready()] == [0.0]
