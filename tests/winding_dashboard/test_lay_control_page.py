"""The controller of the lay on the page: what is shown of it, and its switches."""

import math

import numpy as np
import pytest
from controlled_page import Controlled, note_run
from simulated_page import NOW, Desk, fresh_state

from winding_core.lay.errors import turn_errors, turn_state
from winding_core.lay.records import LAY_CONTROL_DTYPE, ControlBasis, ControlMode
from winding_core.status import Level, Status
from winding_dashboard.drawings.lay_charts import lay_curves
from winding_dashboard.page.snapshot import basis_words, beliefs
from winding_dashboard.state.control_state import ControlState
from winding_dashboard.state.view_state import ViewState

TURN = math.tau
DRIVE, WATCH = ControlMode.DRIVE, ControlMode.WATCH


def controlled(theta: float = 5.5 * TURN, mode: ControlMode = DRIVE) -> ViewState:
    state = fresh_state("winding")
    note_run(state, theta, mode)
    return state


def control_state(basis: ControlBasis, **further: float) -> ControlState:
    record = np.zeros(1, LAY_CONTROL_DTYPE)
    record["basis"], record["mode"], record["pull"] = basis, DRIVE, math.nan
    for name, value in further.items():
        record[name] = value
    control = ControlState()
    control.note(10.0, record)
    return control


def test_fall_backs_are_named_and_stand_out() -> None:
    assert basis_words(control_state(ControlBasis.MEASURED), 10.0) == (
        "the measured lay is fed back",
        False,
    )
    for basis, word in (
        (ControlBasis.MODEL, "TRACKER LOST"),
        (ControlBasis.RAMP, "SOLVER LOST"),
        (ControlBasis.LATE, "COMMANDS LATE"),
    ):
        text, stands_out = basis_words(control_state(basis), 10.0)
        assert text.startswith(word)
        assert stands_out


def test_controller_that_falls_silent_while_time_goes_on_is_reported() -> None:
    text, stands_out = basis_words(control_state(ControlBasis.MEASURED), 13.0)
    assert text == "silent for 3 s of the machine's time"
    assert stands_out


def test_active_bound_is_reported() -> None:
    text, stands_out = basis_words(control_state(ControlBasis.MEASURED, limited=1), 10.0)
    assert text.endswith("a bound of the carriage holds the guide back")
    assert not stands_out


def test_estimates_have_their_deviations_and_uncommanded_values_are_marked() -> None:
    shown = beliefs(
        control_state(ControlBasis.MEASURED, free_length=0.1958, sigma_free_length=0.0055)
    )
    assert shown["Free length"] == "195.8 ± 5.5 mm"
    assert shown["Pull"] == "not set"
    watching = control_state(ControlBasis.MEASURED, mode=WATCH, guide=0.0333, pull=2.5)
    assert beliefs(watching)["Guide"] == "would be 33.3 mm"
    assert beliefs(watching)["Pull"] == "would be 2.50 N"


def test_layers_are_shown_where_there_are_any() -> None:
    control = control_state(ControlBasis.MEASURED)
    assert "Layer" not in beliefs(control)
    values = {
        "mode": "drive",
        "layer": "2",
        "turn_of_layer": "3.40",
        "measured_share_of_layer": "0.25",
        "newest_layer_fault": "gap in layer 2, turn 9: 6.1 mm from the turn before, measured",
    }
    control.note_statuses([Status(name="lay_control", message="drive", values=values)])
    assert beliefs(control)["Layer"] == "2, turn 3.40, 25 % measured"
    assert beliefs(control)["Found"] == values["newest_layer_fault"]
    unseen = {**values, "measured_share_of_layer": "nan", "newest_layer_fault": ""}
    control.note_statuses([Status(name="lay_control", message="drive", values=unseen)])
    assert beliefs(control)["Layer"] == "2, turn 3.40, nothing measured"
    assert beliefs(control)["Found"] == "no gap, climb or missing edge turn"


def test_wanted_line_is_what_was_heard_and_forgotten_with_the_run() -> None:
    state = controlled()
    known = state.control.wanted
    assert known.at([10.0])[0] == pytest.approx(2.87e-3 * 10.0)
    assert np.isnan(known.at([6.0 * TURN])[0])
    state.clear()
    assert np.isnan(state.control.wanted.at([10.0])[0])
    # A reset leaves the controller as it was switched.
    assert state.control.mode is DRIVE


def test_mode_comes_from_diagnostics_while_the_machine_stands() -> None:
    control = control_state(ControlBasis.MEASURED)
    status = Status(name="lay_control", message="off; waiting", values={"mode": "off"})
    control.note_statuses([status, Status(name="lay_control: topics", values={"mode": "drive"})])
    assert control.mode is ControlMode.OFF


def test_turn_with_a_fault_is_off_and_the_first_two_are_not_judged() -> None:
    state = controlled()
    turns = turn_errors(state.lay, state.control.wanted)
    states = [turn_state(turn, 0.5e-3) for turn in turns]
    # The made-up run lies 0.7 mm off in its fourth turn.
    assert states == ["not judged", "not judged", "within", "off", "within", "within"]


def test_curves_are_in_turns_and_millimetres() -> None:
    curves = lay_curves(controlled())
    assert curves["wanted"][-1] == pytest.approx([5.5, 1e3 * 2.87e-3 * 5.5 * TURN], abs=0.3)
    # What is missing behind P0, and the fault of the fourth turn.
    off = dict(map(tuple, curves["measured off"]))
    assert min(off.values()) == pytest.approx(-1.34, abs=0.1)
    assert max(off.values()) == pytest.approx(0.73, abs=0.05)
    assert 3.0 < max(off, key=off.__getitem__) < 4.0
    # The predicted one lags by up to 0.4 mm.
    assert curves["predicted off"][-1][1] == pytest.approx(0.38, abs=0.03)


def test_graph_without_a_controller_has_no_such_panel() -> None:
    state = fresh_state("winding")
    assert Desk(state, Controlled(state)).look()["hidden"]["control-card"]


def test_panel_shows_mode_basis_and_turns() -> None:
    state = controlled()
    seen = Desk(state, Controlled(state)).look()
    assert not seen["hidden"]["control-card"]
    assert seen["texts"]["control-mode"] == "Drive: commands the machine"
    assert seen["texts"]["control-basis"] == "the measured lay is fed back"
    for text in ("195.8 ± 5.5 mm", '<td class="bad">off</td>', "<td>+0.73</td>"):
        assert text in seen["parts"]["turns"]


def test_fall_back_stands_out_on_the_page() -> None:
    state = controlled()
    desk = Desk(state, Controlled(state))
    assert not desk.look()["bad"]["control-basis"]
    state.time += 5.0
    seen = desk.look()
    assert seen["texts"]["control-basis"].startswith("silent for 5 s")
    assert seen["bad"]["control-basis"]


def test_turns_are_held_to_the_tolerance_that_is_set_and_the_run_is_not_judged() -> None:
    state = controlled()
    desk = Desk(state, Controlled(state))
    desk.ask("/limits", limits={"lay_tolerance_mm": 0.8})
    parts = desk.look()["parts"]
    assert ">off<" not in parts["turns"]
    assert "no run is over" in parts["band"]


def test_recording_that_is_played_has_no_switches() -> None:
    state = controlled()
    hidden = Desk(state, Controlled(state, missing="nobody serves")).look()["hidden"]
    assert not hidden["control-card"]
    assert all(hidden[f"mode-{mode}"] for mode in ("off", "watch", "drive"))


def test_leaving_a_machine_that_winds_is_asked_about_first() -> None:
    state = controlled()
    graph = Controlled(state)
    desk = Desk(state, graph)
    assert desk.look()["ask"]["mode-watch"] == "ask-watch"
    desk.ask("/command/lay_control_watch")
    assert graph.done == ["lay_control_watch"]


def test_driving_is_asked_about_and_a_standing_machine_is_left_at_once() -> None:
    state = fresh_state("idle")
    state.note_statuses(NOW, [Status(name="lay_control", level=Level.OK, values={"mode": "watch"})])
    seen = Desk(state, Controlled(state)).look()
    assert seen["ask"]["mode-drive"] == "ask-drive"
    assert seen["ask"]["mode-off"] == ""
    assert seen["pressed"] == {"mode-off": False, "mode-watch": True, "mode-drive": False}


def test_refused_switch_is_one_sentence() -> None:
    state = controlled(mode=WATCH)
    desk = Desk(state, Controlled(state, refusal="lay_control is not active"))
    assert desk.ask("/command/lay_control_off").endswith("lay control: lay_control is not active")
