"""What the page holds back before a click."""

from winding_dashboard.page import commands


def test_stopping_is_never_held_back_by_what_the_page_believes() -> None:
    for phase in ("", "idle", "winding", "stopping", "finished", "emergency stop"):
        assert commands.out_of_phase(commands.STOP, phase) == ""
        assert commands.out_of_phase(commands.EMERGENCY_STOP, phase) == ""


def test_nothing_is_started_while_a_node_is_down() -> None:
    assert commands.asleep({"cable_fem": "inactive"}) == (
        "cable_fem is inactive; wait for it, or prepare the run"
    )
    assert commands.asleep({"cable_fem": "active", "correction": "no answer"}) == ""
