"""What a node counts of a topic's stamps: lost, doubled, reordered, late."""

import pytest

from winding_ros.message_guard import Cadence, MessageGuard, StampError, topic_status

EPOCH = 1.8e9


def test_rate_is_measured_and_losses_are_counted_against_it():
    cadence = Cadence("rig/joint_states")
    for sample in range(400):
        if sample % 20 != 19 or sample < 64:
            cadence.take(EPOCH + 0.025 * sample, 0.025 * sample)
    assert cadence.period == pytest.approx(0.025, abs=1e-6)
    # Every twentieth of 64 to 398: 79, 99, ... 379; that of 399 is not missed yet.
    assert cadence.counts["lost"] == 16
    assert cadence.values()["rate rig/joint_states"] == "40.0"
    assert cadence.warning == "rig/joint_states has lost 4% of its messages at 40 Hz"


def test_an_interruption_is_no_loss_and_lateness_is_seen():
    cadence = Cadence("camera/image_raw")
    for sample in range(100):
        stamp = 0.02 * sample + (30.0 if sample >= 50 else 0.0)
        cadence.take(stamp, stamp + (0.1 if sample >= 70 else 0.0))
    assert cadence.counts == {
        "lost": 0, "doubled": 0, "reordered": 0, "late": 1, "interrupted": 1
    }  # fmt: skip


def test_guard_refuses_what_is_reordered_and_tells_both_kinds():
    guard = MessageGuard("rig/tension", steady=True)
    for sample in range(20):
        guard.check(0.01 * sample, lambda: 0.0)
    guard.check(0.19, lambda: 0.0)
    with pytest.raises(StampError, match="time went back"):
        guard.check(0.15, lambda: 0.0)
    values = topic_status("fem", {}, {"rig/tension": guard}, ()).values
    assert values["doubled rig/tension"] == "1"
    assert values["reordered rig/tension"] == "1"
    guard.restart()
    assert "doubled rig/tension" not in topic_status("fem", {}, {"x": guard}, ()).values
