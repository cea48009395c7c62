"""The page's form prepares a condition."""

import asyncio
from typing import Any

from simulated_page import Desk, Machine, fresh_state, phase

from winding_dashboard.state.view_state import ViewState

OWN = {
    "cylinder_diameter_mm": 30,
    "cable_diameter_mm": 4,
    "tension_n": 3.5,
    "marker_spacing_mm": 80,
}


def at_desk(state: ViewState | None = None, machine: Machine | None = None) -> Desk:
    """Return a desk whose solver has said what it is set to."""
    if state is None:
        state = fresh_state()
        phase(state, "idle")
    desk = Desk(state, machine or Machine())
    asyncio.run(desk.served.session.learn_choice())
    return desk


def form(case: int, law: str = "linear", *, take_up: bool = False, **fields: Any) -> dict[str, Any]:
    return {"case": case, "law": law, "take_up": take_up, "fields": fields}


def test_form_shows_what_the_solver_is_set_to() -> None:
    shown = at_desk().look()["form"]
    assert (shown["case"], shown["law"], shown["take_up"]) == (4, "linear", False)


def test_chosen_case_and_law_are_prepared() -> None:
    desk = at_desk()
    said = desk.ask("/prepare", form=form(9, "hencky"))
    assert desk.graph.done == ["prepare 9 hencky"]
    assert said.endswith("prepare: ready to wind case 9")
    assert desk.look()["form"]["case"] == 9


def test_preparing_over_a_run_asks_first() -> None:
    state = fresh_state()
    phase(state, "finished")
    desk = at_desk(state)
    assert desk.look()["ask"]["prepare"] == ""
    state.time = 20.0
    assert desk.look()["ask"]["prepare"] == "ask-prepare"


def test_nothing_is_chosen_while_the_machine_winds() -> None:
    state = fresh_state()
    phase(state, "winding")
    desk = at_desk(state)
    reason = "cannot be chosen while the machine is winding"
    assert desk.look()["off"]["prepare"] == reason
    assert reason in desk.ask("/prepare", form=form(9))
    assert desk.graph.done == []


def test_own_condition_is_prepared_in_si() -> None:
    desk = at_desk()
    said = desk.ask("/prepare", form=form(0, take_up=True, **OWN))
    assert desk.graph.done == [
        "prepare 0 linear cylinder_diameter=0.03 cable_diameter=0.004 weight=3.5 "
        "marker_spacing=0.08 take up"
    ]
    assert said.endswith("prepare: ready to wind a condition of your own")


def test_wrong_own_condition_is_refused_with_value_and_limits() -> None:
    desk = at_desk()
    assert "say what to wind: Case 1 to 12, or Cylinder" in desk.ask("/prepare", form=form(0))
    said = desk.ask("/prepare", form=form(0, **{**OWN, "cylinder_diameter_mm": 3000}))
    assert "Cylinder diameter, mm must be at most 2000, got 3000" in said
    assert desk.look()["texts"]["prepare-answer"].endswith("at most 2000, got 3000")
    assert desk.graph.done == []


def test_nonsense_in_a_form_is_refused_in_words() -> None:
    desk = at_desk()
    for wrong in (form(99), form(4, "steel"), form(0, **{**OWN, "tension_n": "heavy"}), {}):
        assert "prepare: " in desk.ask("/prepare", form=wrong)
    assert desk.graph.done == []


def test_refused_preparation_says_why_beside_its_button() -> None:
    refusal = "cable_fem cannot configure: the weight is too much"
    desk = at_desk(machine=Machine(refusal=refusal))
    assert desk.ask("/prepare", form=form(4)).endswith(f"prepare: {refusal}")
    assert desk.look()["texts"]["prepare-answer"] == refusal
