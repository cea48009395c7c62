"""Subscription validation: forward time, one publisher, refusals, rate and losses."""

import pytest

from winding_ros.message_guard import (
    GHOST_PATIENCE,
    MAX_JUMP,
    UNKNOWN_NODE,
    Cadence,
    MessageGuard,
    Rivals,
    StampError,
    topic_status,
)


def test_time_may_stand_and_go_forward_but_not_back() -> None:
    intake = MessageGuard("rig/tension")
    for stamp in (1.0, 1.0, 1.5):
        intake.check(stamp, lambda: 0.0)
    with pytest.raises(StampError, match=r"time went back from 1\.500 to 1\.499 s"):
        intake.check(1.499, lambda: 0.0)
    intake.check(1.6, lambda: 0.0)
    # A new run takes the next stamp as it comes.
    intake.restart()
    intake.check(0.0, lambda: 0.0)


def test_jump_is_refused_unless_the_node_s_clock_has_jumped_too() -> None:
    intake = MessageGuard("rig/tension")
    intake.check(1.0, lambda: 1.0)
    later = 1.0 + 2.0 * MAX_JUMP
    with pytest.raises(StampError, match="time jumped"):
        intake.check(later, lambda: 1.0)
    intake.check(later, lambda: later)


def test_refusals_persist_after_fifty_milliseconds_of_nothing_else() -> None:
    intake = MessageGuard("rig/tension")
    intake.refuse("bad", 10.0)
    intake.refuse("bad", 10.04)
    assert not intake.persistent
    intake.refuse("bad", 10.06)
    assert intake.persistent
    intake.accept()
    assert not intake.persistent
    assert (intake.refused, intake.accepted) == (3, 1)


def test_contested_topic_lets_nothing_in() -> None:
    intake = MessageGuard("rig/tension")
    intake.contested = "rig/tension has 2 publishers: /a, /b"
    with pytest.raises(StampError, match="has 2 publishers"):
        intake.check(1.0, lambda: 1.0)


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("rogue", "rig/tension has 2 publishers: /winding/rig, /winding/rogue"),
        # A publisher whose name is not known yet.
        (UNKNOWN_NODE, ""),
    ],
)
def test_second_name_is_a_rival_at_once(name: str, sentence: str) -> None:
    publishers = [("/winding", "rig"), ("/winding", name)]
    assert Rivals().look("rig/tension", publishers[:1], 0.0).sentence == ""
    assert Rivals().look("rig/tension", publishers, 0.0).sentence == sentence


def test_successor_of_a_killed_process_is_no_rival_for_a_while() -> None:
    twice = [("/winding", "marker_tracker")] * 2
    rivals = Rivals().look("tracker/markers", twice, 100.0)
    assert rivals.sentence == ""
    assert rivals.look("tracker/markers", twice, 100.0 + GHOST_PATIENCE).sentence == ""
    assert rivals.look("tracker/markers", twice, 100.1 + GHOST_PATIENCE).sentence != ""
    assert rivals.look("tracker/markers", twice[:1], 105.0) == Rivals()


def test_longest_queue_is_kept_until_it_is_reported() -> None:
    intake = MessageGuard("rig/tension")
    for count in (1, 7, 2):
        intake.found(count)
    assert intake.queue == 7
    intake.restart_queue()
    assert intake.queue == 0


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
