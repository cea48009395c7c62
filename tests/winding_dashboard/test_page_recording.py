"""The page begins and ends recordings."""

import time

from simulated_page import Desk, Machine, fresh_state, phase

from winding_core.status import Level, Status
from winding_dashboard.state.view_state import ViewState


def recorded(state: ViewState, bag: str) -> None:
    values = {"bag": bag, "messages": "12345", "bytes": "67800000", "lost": "0"} if bag else {}
    state.health.note(
        time.monotonic(),
        [Status(name="recorder", level=Level.OK, message="recording", values=values)],
    )


def test_recording_is_begun_and_shown() -> None:
    machine, state = Machine(), fresh_state()
    phase(state, "winding")
    desk = Desk(state, machine)
    assert desk.look()["texts"]["recorded"] == "nothing is being recorded"
    assert desk.look()["hidden"]["recording"]
    desk.ask("/record", on=True)
    assert machine.done == ["record"]
    recorded(state, "bag-2")
    seen = desk.look()
    assert seen["texts"]["recorded"] == "into bag-2: 12 345 messages, 67.8 MB"
    assert seen["texts"]["record"] == "Stop recording"
    assert not seen["hidden"]["recording"]


def test_ending_a_recording_asks_while_the_machine_winds_and_not_when_it_stands() -> None:
    state = fresh_state()
    recorded(state, "bag")
    desk = Desk(state, Machine())
    phase(state, "winding")
    assert desk.look()["ask"]["record"] == "ask-record"
    phase(state, "idle")
    assert desk.look()["ask"]["record"] == ""


def test_ending_a_recording_tells_what_is_in_it() -> None:
    machine = Machine()
    desk = Desk(fresh_state(), machine)
    assert desk.ask("/record", on=False).endswith("recording: bag: 7 messages")
    assert machine.done == ["end"]


def test_recording_that_nobody_serves_is_off_with_a_reason() -> None:
    reason = "nobody serves recorder/record in /winding"
    seen = Desk(fresh_state(), Machine(unrecorded=reason)).look()
    assert seen["off"]["record"] == reason
    assert seen["texts"]["recorded"] == reason
