"""The page's form prepares a condition."""

import time

import pytest
from nicegui import ui
from nicegui.testing import User, user_simulation
from simulated_page import Machine, button, click, fresh_state, phase, until

from winding_dashboard.views.page import Page

pytestmark = [pytest.mark.asyncio, pytest.mark.slow]


async def test_chosen_case_and_law_are_prepared() -> None:
    machine, state = Machine(), fresh_state()
    phase(state, "idle")
    async with user_simulation(lambda: Page(state, machine, time.monotonic)) as user:
        await user.open("/")
        await until(lambda: button(user, "Prepare").enabled)
        case, law = sorted(user.find(ui.select).elements, key=lambda item: item.id)
        assert (case.value, law.value) == (4, "linear")
        case.value, law.value = 9, "hencky"
        click(user, button(user, "Prepare"))
        await until(lambda: machine.done == ["prepare 9 hencky"])
        await user.should_see("prepare: ready to wind case 9", retries=50)


async def test_preparing_over_a_run_asks_first() -> None:
    machine, state = Machine(), fresh_state()
    phase(state, "finished")
    state.time = 20.0
    async with user_simulation(lambda: Page(state, machine, time.monotonic)) as user:
        await user.open("/")
        await until(lambda: button(user, "Prepare").enabled)
        click(user, button(user, "Prepare"))
        await user.should_see("Prepare another run?")
        assert machine.done == []


async def test_nothing_is_chosen_while_the_machine_winds() -> None:
    state = fresh_state()
    phase(state, "winding")
    async with user_simulation(lambda: Page(state, Machine(), time.monotonic)) as user:
        await user.open("/")
        await user.should_see("cannot be chosen while the machine is winding", retries=50)
        assert not button(user, "Prepare").enabled


async def form(user: User) -> dict[str, ui.number]:
    await until(lambda: button(user, "Prepare").enabled)
    case = min(user.find(ui.select).elements, key=lambda item: item.id)
    case.value = 0
    await user.should_see("Cylinder diameter, mm", retries=50)
    return {str(item.props["label"]): item for item in user.find(ui.number).elements}


async def test_own_condition_is_prepared_in_si() -> None:
    machine, state = Machine(), fresh_state()
    phase(state, "idle")
    async with user_simulation(lambda: Page(state, machine, time.monotonic)) as user:
        await user.open("/")
        await user.should_not_see("Cylinder diameter, mm")
        fields = await form(user)
        for value, name in (
            (30.0, "Cylinder diameter, mm"),
            (4.0, "Cable diameter, mm"),
            (3.5, "Weight, N"),
            (80.0, "Marker spacing, mm"),
        ):
            fields[name].value = value
        (take_up,) = user.find(ui.checkbox).elements
        take_up.value = True
        click(user, button(user, "Prepare"))
        await until(lambda: bool(machine.done))
        assert machine.done == [
            "prepare 0 linear cylinder_diameter=0.03 cable_diameter=0.004 weight=3.5 "
            "marker_spacing=0.08 take up"
        ]
        await user.should_see("prepare: ready to wind a condition of your own", retries=50)


async def test_wrong_own_condition_is_refused_with_value_and_limits() -> None:
    machine, state = Machine(), fresh_state()
    phase(state, "idle")
    async with user_simulation(lambda: Page(state, machine, time.monotonic)) as user:
        await user.open("/")
        fields = await form(user)
        click(user, button(user, "Prepare"))
        await user.should_see("say what to wind: Case 1 to 12, or Cylinder", retries=50)
        fields["Cylinder diameter, mm"].value = 3000.0
        click(user, button(user, "Prepare"))
        await user.should_see("Cylinder diameter, mm must be at most 2000, got 3000", retries=50)
        assert machine.done == []


async def test_refused_preparation_says_why_beside_its_button() -> None:
    machine, state = (
        Machine(refusal="cable_fem cannot configure: the weight is too much"),
        (fresh_state()),
    )
    phase(state, "idle")
    async with user_simulation(lambda: Page(state, machine, time.monotonic)) as user:
        await user.open("/")
        await until(lambda: button(user, "Prepare").enabled)
        click(user, button(user, "Prepare"))
        await user.should_see("prepare: cable_fem cannot configure", retries=50)
        await until(
            lambda: any(
                label.text == machine.refusal and "bad" in label.classes
                for label in user.find(ui.label).elements
            )
        )
