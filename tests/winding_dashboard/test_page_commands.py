"""The page's requests command the machine, and refusals are told."""

import math

import pytest
from simulated_page import Desk, Machine, fresh_state, phase

from winding_core.machine.readings import CABLE_TENSION
from winding_dashboard.page import commands
from winding_dashboard.web.server import SEEN_WITHIN


def test_commands_reach_the_machine() -> None:
    machine = Machine()
    desk = Desk(fresh_state(), machine)
    for name in (commands.START, commands.STOP, commands.EMERGENCY_STOP):
        assert desk.ask(f"/command/{name}").endswith(": done")
    assert machine.done == [commands.START, commands.STOP, commands.EMERGENCY_STOP]


def test_reset_asks_first_and_begins_a_new_run() -> None:
    machine, state = Machine(), fresh_state()
    state.measured[CABLE_TENSION] = 3.0
    desk = Desk(state, machine)
    assert desk.look()["ask"]["reset"] == "ask-reset"
    desk.ask("/command/reset")
    assert machine.done == [commands.RESET, "renew"]
    assert math.isnan(state.measured[CABLE_TENSION])


def test_refused_reset_keeps_what_is_shown() -> None:
    state = fresh_state()
    state.measured[CABLE_TENSION] = 3.0
    desk = Desk(state, Machine(refusal="cannot reset while the machine moves"))
    assert desk.ask("/command/reset").endswith("reset: cannot reset while the machine moves")
    assert desk.look()["alarm"]
    assert state.measured[CABLE_TENSION] == 3.0


def test_every_browser_reads_what_the_last_request_came_to() -> None:
    desk = Desk(fresh_state(), Machine(refusal="cannot stop while the machine is in idle"))
    desk.ask("/command/stop")
    assert desk.look()["texts"]["said"].endswith("stop: cannot stop while the machine is in idle")


def test_buttons_are_off_with_a_reason_when_only_topics_come() -> None:
    machine = Machine(missing="nobody serves rig/start in /winding")
    seen = Desk(fresh_state(), machine).look()
    for name in ("start", "stop", "reset", "emergency_stop"):
        assert seen["off"][name] == machine.missing
    assert seen["off"]["prepare"] == f"cannot be chosen here: {machine.missing}"
    assert seen["texts"]["why-off"] == f"Commands are off: {machine.missing}"


def test_reason_why_start_is_off_stands_in_words() -> None:
    state = fresh_state()
    phase(state, "finished")
    seen = Desk(state, Machine()).look()
    assert seen["off"]["start"] == "the run is finished; reset first"
    assert seen["texts"]["why-off"] == "Start is off: the run is finished; reset first"
    assert seen["off"]["emergency_stop"] == ""


def test_nothing_is_started_while_a_node_is_down() -> None:
    state = fresh_state()
    phase(state, "idle")
    state.health.lifecycle = {"winding_rig": "active", "cable_fem": "inactive"}
    seen = Desk(state, Machine()).look()
    assert seen["off"]["start"].startswith("cable_fem is inactive")
    assert seen["off"]["stop"] == ""


class Clock:
    now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.mark.parametrize("name", ["start", "reset"])
def test_what_was_asked_before_an_old_picture_is_not_done(name: str) -> None:
    clock, machine = Clock(), Machine()
    desk = Desk(fresh_state(), machine, clock=clock)
    seen = desk.look()
    clock.now += SEEN_WITHIN + 1.0
    body = {"server": seen["server"], "sequence": seen["sequence"]}
    said = desk.request("POST", f"/command/{name}", json=body).json()["said"]
    assert said.endswith(f"{name}: nothing was done, for the page was 6 s old; look again")
    assert machine.done == []


def test_two_requests_after_one_look_are_both_carried_out() -> None:
    machine = Machine()
    desk = Desk(fresh_state(), machine)
    seen = desk.look()
    body = {"server": seen["server"], "sequence": seen["sequence"]}
    for name in ("start", "reset"):
        desk.request("POST", f"/command/{name}", json=body)
    assert machine.done == [commands.START, commands.RESET, "renew"]


@pytest.mark.parametrize("name", ["stop", "emergency_stop"])
def test_stops_are_carried_out_whatever_was_seen(name: str) -> None:
    machine = Machine()
    desk = Desk(fresh_state(), machine)
    assert desk.request("POST", f"/command/{name}", json={}).status_code == 200
    assert machine.done == [name]


def test_request_of_another_server_is_of_the_past() -> None:
    machine = Machine()
    desk = Desk(fresh_state(), machine, server="second")
    seen = desk.look()
    body = {"server": "first", "sequence": seen["sequence"]}
    assert "too old" in desk.request("POST", "/command/start", json=body).json()["said"]
    assert machine.done == []


@pytest.mark.parametrize(
    ("path", "given", "status"),
    [
        ("/command/explode", {"json": {}}, 404),
        ("/mode/fly", {"json": {}}, 404),
        ("/command/stop", {"content": b"{}"}, 400),
        ("/command/stop", {"json": [1]}, 400),
        ("/prepare", {"json": {"form": "x" * 200_000}}, 400),
    ],
)
def test_request_that_is_none_is_refused(path: str, given: dict, status: int) -> None:
    machine = Machine()
    answer = Desk(fresh_state(), machine).request("POST", path, **given)
    assert answer.status_code == status
    assert machine.done == []


def test_an_address_that_does_not_exist_is_not_found() -> None:
    answer = Desk(fresh_state(), Machine()).request("GET", "/report")
    assert answer.status_code == 404
    assert "there is no page /report" in answer.text
