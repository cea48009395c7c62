"""What the page holds back before a click."""

from winding_core.status import RunPhase
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


def test_next_run_is_asked_for_between_two_runs() -> None:
    def off(command: str, phase: RunPhase | None, *, moving: bool = False) -> bool:
        return bool(commands.between_runs(command, phase, moving=moving))

    assert not off(commands.START, None)
    assert not off(commands.RESET, None)
    assert not off(commands.START, RunPhase.READY)
    assert off(commands.START, RunPhase.OVER)
    assert not off(commands.RESET, RunPhase.OVER)
    assert off(commands.START, RunPhase.PREPARED)
    assert off(commands.RESET, RunPhase.PREPARED)
    assert off(commands.RESET, RunPhase.UNDER_WAY, moving=True)
    # A run that was broken off stands.
    assert not off(commands.RESET, RunPhase.UNDER_WAY)
    for phase in RunPhase:
        assert not off(commands.STOP, phase, moving=True)
        assert not off(commands.EMERGENCY_STOP, phase, moving=True)
