"""Requests of the page: commands, preparation of a condition, recordings, and their refusals."""

import math
from typing import Any

import pytest
from simulated_page import NOW, OWN_FIELDS, Clock, Desk, Machine, at_desk, form, fresh_state, phase

from winding_core.machine.readings import CABLE_TENSION
from winding_core.status import Level, RunPhase, Status
from winding_dashboard.page import commands
from winding_dashboard.state.view_state import ViewState
from winding_dashboard.web.server import SEEN_WITHIN


def recorded(state: ViewState, bag: str) -> None:
    values = {"bag": bag, "messages": "12345", "bytes": "67800000", "lost": "0"} if bag else {}
    state.health.note(
        NOW, [Status(name="recorder", level=Level.OK, message="recording", values=values)]
    )


def test_recording_is_begun_and_shown() -> None:
    state = fresh_state("winding")
    desk = Desk(state)
    assert desk.look()["texts"]["recorded"] == "nothing is being recorded"
    assert desk.look()["hidden"]["recording"]
    # It stays true whatever becomes of the recording.
    assert desk.ask("/record", on=True).endswith("recording: begun")
    assert desk.graph.done == ["record"]
    recorded(state, "bag-2")
    seen = desk.look()
    assert seen["texts"]["recorded"] == "into bag-2: 12 345 messages, 67.8 MB"
    assert seen["texts"]["record"] == "Stop recording"
    assert not seen["hidden"]["recording"]


def test_recording_ends_with_its_session() -> None:
    state = fresh_state()
    recorded(state, "bag-3")
    failure = "the session cannot go on: winding_rig ended with exit code -9"
    state.note_statuses(
        NOW, [Status(name="orchestrator: run", message=failure, values={"phase": "failed"})]
    )
    seen = Desk(state).look()
    assert seen["texts"]["recorded"] == "nothing is being recorded"
    assert seen["hidden"]["recording"]
    assert failure in seen["parts"]["band"]


def test_ending_a_recording_asks_while_the_machine_winds_and_not_when_it_stands() -> None:
    state = fresh_state()
    recorded(state, "bag")
    desk = Desk(state)
    phase(state, "winding")
    assert desk.look()["ask"]["record"] == "ask-record"
    phase(state, "idle")
    assert desk.look()["ask"]["record"] == ""


def test_ending_a_recording_reports_what_is_in_it() -> None:
    desk = Desk()
    assert desk.ask("/record", on=False).endswith("recording: bag: 7 messages")
    assert desk.graph.done == ["end"]


def test_recording_that_nobody_serves_is_off_with_a_reason() -> None:
    reason = "nobody serves recorder/record in /winding"
    seen = Desk(graph=Machine(unrecorded=reason)).look()
    assert seen["off"]["record"] == reason
    assert seen["texts"]["recorded"] == reason


def test_form_shows_what_the_solver_is_set_to() -> None:
    shown = at_desk().look()["form"]
    assert (shown["case"], shown["law"], shown["take_up"]) == (4, "linear", False)


def test_chosen_case_and_law_are_prepared() -> None:
    desk = at_desk()
    answer = desk.ask("/prepare", form=form(9, "hencky"))
    assert desk.graph.done == ["prepare 9 hencky"]
    assert answer.endswith("prepare: ready to wind case 9")
    assert desk.look()["form"]["case"] == 9


def test_preparing_over_a_run_asks_first() -> None:
    state = fresh_state("finished")
    desk = at_desk(state)
    assert desk.look()["ask"]["prepare"] == ""
    state.time = 20.0
    assert desk.look()["ask"]["prepare"] == "ask-prepare"


def test_nothing_is_chosen_while_the_machine_winds() -> None:
    desk = at_desk(fresh_state("winding"))
    reason = "cannot be chosen while the machine is winding"
    assert desk.look()["off"]["prepare"] == reason
    assert reason in desk.ask("/prepare", form=form(9))
    assert desk.graph.done == []


def test_own_condition_is_prepared_in_si() -> None:
    desk = at_desk()
    answer = desk.ask("/prepare", form=form(0, take_up=True, **OWN_FIELDS))
    assert desk.graph.done == [
        "prepare 0 linear cylinder_diameter=0.03 cable_diameter=0.004 weight=3.5 "
        "marker_spacing=0.08 take up"
    ]
    assert answer.endswith("prepare: ready to wind an own condition")


def test_wrong_own_condition_is_refused_with_value_and_limits() -> None:
    desk = at_desk()
    assert "say what to wind: Case 1 to 12, or Cylinder" in desk.ask("/prepare", form=form(0))
    answer = desk.ask("/prepare", form=form(0, **{**OWN_FIELDS, "cylinder_diameter_mm": 3000}))
    assert "Cylinder diameter, mm must be at most 2000, got 3000" in answer
    assert desk.look()["texts"]["prepare-answer"].endswith("at most 2000, got 3000")
    assert desk.graph.done == []


def test_nonsense_in_a_form_is_refused_in_words() -> None:
    desk = at_desk()
    for wrong in (form(99), form(4, "steel"), form(0, **{**OWN_FIELDS, "tension_n": "heavy"}), {}):
        assert "prepare: " in desk.ask("/prepare", form=wrong)
    assert desk.graph.done == []


def test_refused_preparation_shows_the_reason_beside_its_button() -> None:
    refusal = "cable_fem cannot configure: the weight is too much"
    desk = at_desk(machine=Machine(refusal=refusal))
    assert desk.ask("/prepare", form=form(4)).endswith(f"prepare: {refusal}")
    assert desk.look()["texts"]["prepare-answer"] == refusal


def test_commands_reach_the_machine() -> None:
    desk = Desk()
    for name in (commands.START, commands.STOP, commands.EMERGENCY_STOP):
        assert desk.ask(f"/command/{name}").endswith(": done")
    assert desk.graph.done == [commands.START, commands.STOP, commands.EMERGENCY_STOP]


def test_reset_asks_first_and_begins_a_new_run() -> None:
    state = fresh_state()
    state.measured[CABLE_TENSION] = 3.0
    desk = Desk(state)
    assert desk.look()["ask"]["reset"] == "ask-reset"
    desk.ask("/command/reset")
    assert desk.graph.done == [commands.RESET, "renew"]
    assert math.isnan(state.measured[CABLE_TENSION])


def test_refused_reset_keeps_what_is_shown() -> None:
    state = fresh_state()
    state.measured[CABLE_TENSION] = 3.0
    desk = Desk(state, Machine(refusal="cannot reset while the machine moves"))
    assert desk.ask("/command/reset").endswith("reset: cannot reset while the machine moves")
    assert desk.look()["alarm"]
    assert state.measured[CABLE_TENSION] == 3.0


def test_every_browser_reads_what_the_last_request_came_to() -> None:
    desk = Desk(graph=Machine(refusal="cannot stop while the machine is in idle"))
    desk.ask("/command/stop")
    assert desk.look()["texts"]["answer"].endswith("stop: cannot stop while the machine is in idle")


def test_stops_are_offered_even_where_nothing_else_can_be_commanded() -> None:
    machine = Machine(missing="nobody serves rig/start in /winding")
    seen = Desk(fresh_state(), machine).look()
    assert seen["off"]["start"] == seen["off"]["reset"] == machine.missing
    assert seen["off"]["prepare"] == f"cannot be chosen here: {machine.missing}"
    assert seen["texts"]["why-off"] == f"Start is off: {machine.missing}"
    assert seen["off"]["stop"] == seen["off"]["emergency_stop"] == ""


def test_played_recording_has_nothing_to_command_prepare_or_record() -> None:
    state = fresh_state("winding")
    recorded(state, "bag-7")
    state.player = "bag_player"
    seen = Desk(state).look()
    reason = "a recording is played; there is no machine"
    commanded = ("start", "stop", "reset", "emergency_stop", "record", "mode-drive")
    assert {seen["off"][name] for name in commanded} == {reason}
    assert seen["off"]["prepare"] == f"cannot be chosen here: {reason}"
    assert seen["texts"]["why-off"] == f"Commands are off: {reason}"
    assert "PLAYBACK" in seen["parts"]["band"]
    assert "WINDING" not in seen["parts"]["band"]
    assert "recorded: winding" in seen["parts"]["band"]
    # The recorder of that day is not at work.
    assert seen["hidden"]["recording"]
    assert seen["texts"]["recorded"] == reason
    assert seen["texts"]["nodes-title"] == "Nodes, as recorded"


def test_reason_why_start_is_off_stands_in_words() -> None:
    seen = Desk(fresh_state("finished")).look()
    assert seen["off"]["start"] == "the run is finished; reset first"
    assert seen["texts"]["why-off"] == "Start is off: the run is finished; reset first"
    assert seen["off"]["emergency_stop"] == ""


def just_begun(state: ViewState) -> None:
    phase(state, "idle", now=NOW - 0.3)


def silent(state: ViewState) -> None:
    phase(state, "idle", now=NOW - 8.0)


def unconfigured(state: ViewState) -> None:
    phase(state, "idle")
    state.health.lifecycle["cable_fem"] = "unconfigured"


def unanswered(state: ViewState) -> None:
    phase(state, "idle")
    state.health.lifecycle = {"winding_rig": "active"}


@pytest.mark.parametrize(
    ("known", "reason"),
    [
        (lambda _state: None, "no data from the machine"),
        (silent, "no data from the machine"),
        (just_begun, "the page has just begun to listen"),
        (unconfigured, "cable_fem is unconfigured; wait for it, or prepare the run"),
        (unanswered, "cable_fem has not answered yet"),
    ],
)
def test_start_is_offered_by_a_page_that_knows_the_present_alone(known: Any, reason: str) -> None:
    """As after a restart of the page's process, or of an attached node's."""
    state = fresh_state()
    known(state)
    seen = Desk(state).look()
    assert seen["off"]["start"] == reason
    assert seen["off"]["stop"] == seen["off"]["emergency_stop"] == ""


def test_busy_node_does_not_hold_the_start_back() -> None:
    state = fresh_state("idle")
    state.health.lifecycle["cable_fem"] = "no answer"
    assert Desk(state).look()["off"]["start"] == ""


def test_form_is_checked_before_the_present_run_is_given_up() -> None:
    state = fresh_state("finished")
    state.time = 17.0
    desk = at_desk(state)
    wrong = form(0, **{**OWN_FIELDS, "cable_diameter_mm": 250})
    assert "Cable diameter, mm must be at most 100, got 250" in desk.ask(
        "/prepare", form={**wrong, "check": True}
    )
    assert desk.look()["alarm"]
    said = desk.ask("/prepare", form={**form(11), "check": True})
    assert said.endswith("prepare: the form is complete; the present run will be dropped")
    assert not desk.look()["alarm"]
    assert desk.graph.done == []


@pytest.mark.parametrize(
    ("path", "asked", "sentence"),
    [
        ("/limits", {"limits": {"error_limit_pct": ""}}, "Error of a length, % is empty; give"),
        ("/limits", {"limits": {"lay_tolerance_mm": None}}, "Lay, mm is empty; give a number"),
        (
            "/prepare",
            {"form": form(0, **{**OWN_FIELDS, "cylinder_diameter_mm": ""})},
            "missing Cylinder diameter, mm",
        ),
    ],
)
def test_empty_field_is_refused_by_its_name(path: str, asked: dict, sentence: str) -> None:
    desk = at_desk()
    assert sentence in desk.ask(path, **asked)
    assert desk.look()["alarm"]
    assert desk.graph.done == []


@pytest.mark.parametrize("name", ["start", "reset"])
def test_what_was_asked_before_an_old_picture_is_not_done(name: str) -> None:
    clock = Clock()
    desk = Desk(clock=clock)
    seen = desk.look()
    clock.now += SEEN_WITHIN + 1.0
    body = {"server": seen["server"], "sequence": seen["sequence"]}
    answer = desk.request("POST", f"/command/{name}", json=body).json()["answer"]
    assert answer.endswith(f"{name}: nothing was done, for the page was 6 s old; look again")
    assert desk.graph.done == []


def test_two_requests_after_one_look_are_both_carried_out() -> None:
    desk = Desk()
    seen = desk.look()
    body = {"server": seen["server"], "sequence": seen["sequence"]}
    for name in ("start", "reset"):
        desk.request("POST", f"/command/{name}", json=body)
    assert desk.graph.done == [commands.START, commands.RESET, "renew"]


@pytest.mark.parametrize("name", ["stop", "emergency_stop"])
def test_stops_are_carried_out_whatever_was_seen(name: str) -> None:
    desk = Desk()
    assert desk.request("POST", f"/command/{name}", json={}).status_code == 200
    assert desk.graph.done == [name]


def test_request_of_another_server_is_of_the_past() -> None:
    desk = Desk(server="second")
    seen = desk.look()
    body = {"server": "first", "sequence": seen["sequence"]}
    assert "too old" in desk.request("POST", "/command/start", json=body).json()["answer"]
    assert desk.graph.done == []


@pytest.mark.parametrize(
    ("path", "given", "status"),
    [
        ("/command/explode", {"json": {}}, 404),
        ("/command/lay_control_fly", {"json": {}}, 404),
        ("/recipe/burn", {"json": {}}, 404),
        ("/command/stop", {"content": b"{}"}, 400),
        ("/command/stop", {"json": [1]}, 400),
        ("/prepare", {"json": {"form": "x" * 200_000}}, 400),
    ],
)
def test_request_that_is_none_is_refused(path: str, given: dict, status: int) -> None:
    desk = Desk()
    assert desk.request("POST", path, **given).status_code == status
    assert desk.graph.done == []


def test_an_address_that_does_not_exist_is_not_found() -> None:
    answer = Desk().request("GET", "/report")
    assert answer.status_code == 404
    assert "there is no page /report" in answer.text


@pytest.mark.parametrize("moving", [False, True])
def test_stopping_is_never_held_back_by_what_the_page_believes(moving: bool) -> None:
    for reached in ("", "idle", "winding", "stopping", "finished", "emergency stop"):
        for run in (None, *RunPhase):
            for name in commands.STOPS:
                assert commands.untimely(name, reached, run, moving=moving) == ""


def test_next_run_is_asked_for_between_two_runs() -> None:
    def off(command: str, run: RunPhase | None, *, moving: bool = False) -> bool:
        return bool(commands.untimely(command, "", run, moving=moving))

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


def playing(position: float, *, paused: bool = False) -> ViewState:
    """Return what is known of a recording of 42.5 s that is played at a place [s]."""
    state = fresh_state()
    values = {"position": f"{position}", "length": "42.5", "paused": f"{float(paused)}"}
    state.note_statuses(NOW, [Status(name="bag_player: playback", values=values)])
    state.player = "bag_player"
    return state


def test_playback_shows_its_place_and_goes_where_it_is_sent() -> None:
    desk = Desk(playing(7.25, paused=True))
    seen = desk.look()
    assert seen["playback"] == {"position": 7.25, "length": 42.5, "paused": 1.0}
    assert not seen["hidden"]["playback"]
    desk.ask("/playback", position=31.5)
    desk.ask("/playback", paused=False)
    assert desk.graph.done == ["play {'position': 31.5}", "play {'paused': False}"]
    assert "playback: give a position" in desk.ask("/playback", position="far")
    refused = Desk(playing(1.0), Machine(refusal="bag_player: position must be from 0 to 42.5 s"))
    assert refused.ask("/playback", position=99).endswith("must be from 0 to 42.5 s")


def test_page_of_a_machine_or_of_another_player_has_no_slider() -> None:
    state = playing(3.0)
    for player, known in (("", True), ("rosbag2_player", False)):
        state.player = player
        if not known:
            state.health.forget("bag_player")
        seen = Desk(state).look()
        assert seen["playback"] is None
        assert seen["hidden"]["playback"]
