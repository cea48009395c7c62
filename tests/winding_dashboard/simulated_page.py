"""A graph that answers the page as a test wants, and the hands of NiceGUI's simulated user."""

import asyncio
import time
from collections.abc import Callable

from nicegui import ui
from nicegui.testing import User, UserInteraction

from winding_core.condition import OWN, Condition
from winding_core.status import Level, Status
from winding_dashboard.views.commands import Choice, CommandError
from winding_dashboard.views.view_state import ViewState

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
