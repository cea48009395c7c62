"""The page's logic by NiceGUI's simulated user: no browser, the real view state."""

import asyncio
import math
import time
from collections.abc import Callable

import numpy as np
import pytest
from nicegui import ui
from nicegui.testing import User, UserInteraction, user_simulation

from winding_core.condition import OWN, Condition
from winding_core.markers import CORRECTED_DTYPE, wound_markers
from winding_core.material_report import MaterialReport
from winding_core.readings import CABLE_TENSION, AxisReading
from winding_core.status import Level, Status
from winding_dashboard.views import commands
from winding_dashboard.views.commands import Choice, CommandError
from winding_dashboard.views.page import Page
from winding_dashboard.views.view_state import ViewState

pytestmark = [pytest.mark.asyncio, pytest.mark.slow]
NODES = ("winding_rig", "cable_fem")
PATIENCE = 10.0


class Machine:
    """A graph that does as it is told, or refuses with a sentence."""

    def __init__(self, *, missing: str = "", refusal: str = "", unrecorded: str = "") -> None:
        self.missing, self.refusal = missing, refusal
        self._unrecorded = unrecorded
        self.done: list[str] = []

    def unavailable(self, command: str) -> str:
        return self.missing

    async def command(self, command: str) -> str:
        if self.refusal:
            raise CommandError(self.refusal)
        self.done.append(command)
        return "done"

    def unprepared(self) -> str:
        return self.missing

    async def choice(self) -> Choice:
        return Choice(condition=Condition())

    async def prepare(self, choice: Choice, tell: Callable[[str], None]) -> str:
        tell("building")
        if self.refusal:
            raise CommandError(self.refusal)
        what = choice.condition
        own = " ".join(f"{name}={getattr(what, name):g}" for name in OWN if getattr(what, name))
        take_up = "take up" if choice.take_up else ""
        self.done.append(f"prepare {what.case} {what.law} {own} {take_up}".strip())
        return ""

    def unrecorded(self) -> str:
        return self._unrecorded

    async def record(self, on: bool) -> str:
        if self.refusal:
            raise CommandError(self.refusal)
        self.done.append("record" if on else "end")
        return "recording into bag" if on else "bag: 7 messages"

    async def renew(self) -> None:
        self.done.append("renew")


def fresh_state() -> ViewState:
    return ViewState(nodes=NODES, machine="winding_rig")


def phase(state: ViewState, text: str, level: Level = Level.OK) -> None:
    state.health.note(time.monotonic(), [Status(name="winding_rig", level=level, message=text)])


async def until(reached: Callable[[], bool]) -> None:
    async with asyncio.timeout(PATIENCE):
        while not reached():
            await asyncio.sleep(0.01)


def buttons(user: User, text: str) -> list[ui.button]:
    """Return the buttons of a text: the page's own first, then those of its dialogs."""
    found = (item for item in user.find(ui.button).elements if item.text == text)
    return sorted(found, key=lambda item: item.id)


def button(user: User, text: str) -> ui.button:
    return buttons(user, text)[0]


def click(user: User, element: ui.button) -> None:
    UserInteraction(user, {element}, None).click()


async def test_numbers_of_the_run_are_shown() -> None:
    state = fresh_state()
    phase(state, "winding")
    state.note_axes(
        12.3,
        AxisReading(
            cylinder_angle=20.0, angular_speed=1.74, carriage_position=0.06, feed_speed=0.005
        ),
    )
    state.measured[CABLE_TENSION] = 3.92
    tracked = wound_markers(
        ids=[1], theta=np.array([6.0]), z=[0.01], radius=0.017, cylinder_angle=20.0
    )
    state.note_tracked(12.3, tracked)
    corrected = np.zeros(1, CORRECTED_DTYPE)
    corrected["id"], corrected["s"], corrected["s_low"], corrected["s_high"] = 1, 0.1, 0.09, 0.11
    state.corrected = corrected
    state.note_votes({3: 0.25, 4: 0.75})
    async with user_simulation(lambda: Page(state, Machine(), time.monotonic)) as user:
        await user.open("/")
        for text in ("winding", "12.3 s", "1.740", "5.00", "3.92", "100.00", "90.0–110.0"):
            await user.should_see(text)
        await user.should_see("102.49")
        await user.should_see("+2.49 %")
        await user.should_see("75%, 3: 25%")


async def test_changes_are_pushed() -> None:
    state = fresh_state()
    async with user_simulation(lambda: Page(state, Machine(), time.monotonic)) as user:
        await user.open("/")
        await user.should_see("nothing heard")
        phase(state, "emergency stop", Level.ERROR)
        await user.should_see("emergency stop", retries=50)
        await user.should_see("ERROR", retries=50)


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


async def test_material_is_told_with_its_half_width() -> None:
    state = fresh_state()
    async with user_simulation(lambda: Page(state, Machine(), time.monotonic)) as user:
        await user.open("/")
        await user.should_see("Effective modulus: no marker is measured yet")
        state.material = MaterialReport(
            law="neo_hookean",
            young=2.61e6,
            standard_error=3.0e4,
            half_width_90=5.2e4,
            markers=(1, 2),
            worst_share=0.01,
            taken_up=False,
        )
        await user.should_see(
            "Effective modulus 2.610 ± 0.052 MPa (nine times in ten), neo hookean, from P1, P2; "
            "the model keeps its own",
            retries=50,
        )


async def test_nothing_is_started_while_a_node_is_down() -> None:
    state = fresh_state()
    phase(state, "idle")
    state.health.lifecycle = {"winding_rig": "active", "cable_fem": "inactive"}
    async with user_simulation(lambda: Page(state, Machine(), time.monotonic)) as user:
        await user.open("/")
        await until(lambda: not button(user, "Start").enabled)
        assert button(user, "Start").props["title"].startswith("cable_fem is inactive")
        assert button(user, "Stop").enabled


async def test_text_from_the_graph_is_text_and_never_markup() -> None:
    state = fresh_state()
    phase(state, "<b>idle</b>")
    async with user_simulation(lambda: Page(state, Machine(), time.monotonic)) as user:
        await user.open("/")
        shown = user.find("<b>idle</b>").elements
        assert {type(element) for element in shown} == {ui.label}
