"""The page begins and ends recordings."""

import time

import pytest
from nicegui.testing import user_simulation
from simulated_page import Machine, button, buttons, click, fresh_state, phase, until

from winding_core.status import Level, Status
from winding_dashboard.views.page import Page
from winding_dashboard.views.view_state import ViewState

pytestmark = [pytest.mark.asyncio, pytest.mark.slow]


def recorded(state: ViewState, bag: str) -> None:
    values = {"bag": bag, "messages": "12345", "bytes": "67800000", "lost": "0"} if bag else {}
    state.health.note(
        time.monotonic(),
        [Status(name="recorder", level=Level.OK, message="recording", values=values)],
    )


async def test_recording_is_begun_and_shown() -> None:
    machine, state = Machine(), fresh_state()
    phase(state, "winding")
    async with user_simulation(lambda: Page(state, machine, time.monotonic)) as user:
        await user.open("/")
        await user.should_see("nothing is being recorded", retries=50)
        click(user, button(user, "Record"))
        await until(lambda: machine.done == ["record"])
        recorded(state, "bag-2")
        await user.should_see("into bag-2: 12 345 messages, 67.8 MB", retries=50)


async def test_ending_a_recording_asks_while_the_machine_winds() -> None:
    machine, state = Machine(), fresh_state()
    phase(state, "winding")
    recorded(state, "bag")
    async with user_simulation(lambda: Page(state, machine, time.monotonic)) as user:
        await user.open("/")
        await user.should_see("into bag:", retries=50)
        click(user, button(user, "Stop recording"))
        await user.should_see("Stop recording while the machine winds?", retries=50)
        assert machine.done == []
        click(user, buttons(user, "Stop recording")[-1])
        await until(lambda: machine.done == ["end"])


async def test_ending_a_recording_of_a_machine_that_stands_asks_nothing() -> None:
    machine, state = Machine(), fresh_state()
    phase(state, "idle")
    recorded(state, "bag")
    async with user_simulation(lambda: Page(state, machine, time.monotonic)) as user:
        await user.open("/")
        await user.should_see("into bag:", retries=50)
        click(user, button(user, "Stop recording"))
        await until(lambda: machine.done == ["end"])
        await user.should_see("recording: bag: 7 messages", retries=50)


async def test_recording_that_nobody_serves_is_off_with_a_reason() -> None:
    machine, state = Machine(unrecorded="nobody serves recorder/record in /winding"), fresh_state()
    async with user_simulation(lambda: Page(state, machine, time.monotonic)) as user:
        await user.open("/")
        await user.should_see("nobody serves recorder/record in /winding", retries=50)
        assert not button(user, "Record").enabled
