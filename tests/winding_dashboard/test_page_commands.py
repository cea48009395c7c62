"""The page's buttons command the machine, ask first where that is due, and say refusals."""

import math
import time

import pytest
from nicegui.testing import user_simulation
from simulated_page import Machine, button, buttons, click, fresh_state, phase, until

from winding_core.readings import CABLE_TENSION
from winding_dashboard.views import commands
from winding_dashboard.views.page import Page

pytestmark = [pytest.mark.asyncio, pytest.mark.slow]


async def test_emergency_stop_asks_nothing() -> None:
    machine = Machine()
    async with user_simulation(lambda: Page(fresh_state(), machine, time.monotonic)) as user:
        await user.open("/")
        click(user, button(user, "EMERGENCY STOP"))
        await until(lambda: machine.done == [commands.EMERGENCY_STOP])


async def test_reset_asks_first_and_begins_a_new_run() -> None:
    machine, state = Machine(), fresh_state()
    state.measured[CABLE_TENSION] = 3.0
    async with user_simulation(lambda: Page(state, machine, time.monotonic)) as user:
        await user.open("/")
        page_button, dialog_button = buttons(user, "Reset")
        click(user, page_button)
        await user.should_see("Reset the machine to the start of a run?")
        assert machine.done == []
        assert state.measured[CABLE_TENSION] == 3.0
        click(user, dialog_button)
        await until(lambda: machine.done == [commands.RESET, "renew"])
        assert math.isnan(state.measured[CABLE_TENSION])


async def test_refused_reset_keeps_what_is_shown() -> None:
    machine, state = Machine(refusal="cannot reset while the machine moves"), fresh_state()
    state.measured[CABLE_TENSION] = 3.0
    async with user_simulation(lambda: Page(state, machine, time.monotonic)) as user:
        await user.open("/")
        click(user, buttons(user, "Reset")[1])
        await user.should_see("reset: cannot reset while the machine moves", retries=50)
        assert state.measured[CABLE_TENSION] == 3.0


async def test_refusal_is_told_in_the_graphs_own_words() -> None:
    machine = Machine(refusal="cannot stop while the machine is in idle")
    async with user_simulation(lambda: Page(fresh_state(), machine, time.monotonic)) as user:
        await user.open("/")
        click(user, button(user, "Stop"))
        await user.should_see("stop: cannot stop while the machine is in idle", retries=50)


async def test_buttons_are_off_with_a_reason_when_only_topics_come() -> None:
    machine = Machine(missing="nobody serves rig/start in /winding")
    async with user_simulation(lambda: Page(fresh_state(), machine, time.monotonic)) as user:
        await user.open("/")
        for text in ("Start", "Stop", "Reset", "EMERGENCY STOP", "Prepare"):
            assert not button(user, text).enabled
        assert button(user, "Start").props["title"] == machine.missing
        await user.should_see("Commands are off: nobody serves rig/start in /winding")
        await user.should_see("cannot be chosen here: nobody serves rig/start in /winding")


async def test_start_waits_for_a_reset_when_the_run_is_over() -> None:
    state = fresh_state()
    phase(state, "finished")
    async with user_simulation(lambda: Page(state, Machine(), time.monotonic)) as user:
        await user.open("/")
        assert not button(user, "Start").enabled
        assert button(user, "Start").props["title"] == "the run is finished; reset first"
        assert button(user, "EMERGENCY STOP").enabled


async def test_nothing_is_started_while_a_node_is_down() -> None:
    state = fresh_state()
    phase(state, "idle")
    state.health.lifecycle = {"winding_rig": "active", "cable_fem": "inactive"}
    async with user_simulation(lambda: Page(state, Machine(), time.monotonic)) as user:
        await user.open("/")
        await until(lambda: not button(user, "Start").enabled)
        assert button(user, "Start").props["title"].startswith("cable_fem is inactive")
        assert button(user, "Stop").enabled
