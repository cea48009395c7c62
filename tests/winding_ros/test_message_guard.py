"""What a node lets in: time forward, one publisher, refusals counted."""

import pytest

from winding_ros.message_guard import (
    GHOST_PATIENCE,
    MAX_JUMP,
    UNKNOWN_NODE,
    MessageGuard,
    Rivals,
    StampError,
)


def test_time_may_stand_and_go_forward_but_not_back() -> None:
    intake = MessageGuard("rig/tension")
    for stamp in (1.0, 1.0, 1.5):
        intake.check(stamp, lambda: 0.0)
    with pytest.raises(StampError, match=r"time went back from 1\.500 to 1\.499 s"):
        intake.check(1.499, lambda: 0.0)
    intake.check(1.6, lambda: 0.0)


def test_jump_is_refused_unless_the_node_s_clock_has_jumped_too() -> None:
    intake = MessageGuard("rig/tension")
    intake.check(1.0, lambda: 1.0)
    later = 1.0 + 2.0 * MAX_JUMP
    with pytest.raises(StampError, match="time jumped"):
        intake.check(later, lambda: 1.0)
    intake.check(later, lambda: later)


def test_new_run_takes_the_next_stamp_as_it_comes() -> None:
    intake = MessageGuard("rig/tension")
    intake.check(5.0, lambda: 5.0)
    intake.restart()
    intake.check(0.0, lambda: 5.0)


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


def test_second_name_is_a_rival_at_once() -> None:
    one, other = ("/winding", "winding_rig"), ("/winding", "rogue")
    assert Rivals().look("rig/tension", [one], 0.0).sentence == ""
    assert (
        Rivals().look("rig/tension", [one, other], 0.0).sentence
        == "rig/tension has 2 publishers: /winding/rogue, /winding/winding_rig"
    )


def test_successor_of_a_killed_process_is_no_rival_for_a_while() -> None:
    twice = [("/winding", "marker_tracker")] * 2
    rivals = Rivals().look("tracker/markers", twice, 100.0)
    assert rivals.sentence == ""
    assert rivals.look("tracker/markers", twice, 100.0 + GHOST_PATIENCE).sentence == ""
    assert rivals.look("tracker/markers", twice, 100.1 + GHOST_PATIENCE).sentence != ""
    assert rivals.look("tracker/markers", twice[:1], 105.0) == Rivals()


def test_publisher_whose_name_is_not_known_yet_is_no_rival() -> None:
    assert Rivals().look("x", [("/", "a"), ("/", UNKNOWN_NODE)], 0.0).sentence == ""


def test_longest_queue_is_kept_until_it_is_told() -> None:
    intake = MessageGuard("rig/tension")
    for count in (1, 7, 2):
        intake.found(count)
    assert intake.queue == 7
    intake.restart_queue()
    assert intake.queue == 0
