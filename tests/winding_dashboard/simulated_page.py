"""A graph that answers the page as a test wants, and the page's server without a socket."""

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx

from winding_core.cable.condition import OWN, Condition
from winding_core.cable.wound_label import WoundLabel
from winding_core.machine.drum import Drum
from winding_core.run_options import OperatorLimits
from winding_core.status import Level, Status
from winding_dashboard.page.commands import Choice, CommandError, Graph
from winding_dashboard.page.recipes import Recipes
from winding_dashboard.page.run_list import RunList
from winding_dashboard.page.session import OperatorSession
from winding_dashboard.page.snapshot import Snapshots
from winding_dashboard.page.templates import Templates
from winding_dashboard.state.view_state import ViewState
from winding_dashboard.web.server import application

NODES = ("winding_rig", "cable_fem")
URL = "http://127.0.0.1"
# An own condition as the form has it, in the units of its labels.
OWN_FIELDS = {
    "cylinder_diameter_mm": 30,
    "cable_diameter_mm": 4,
    "tension_n": 3.5,
    "marker_spacing_mm": 80,
}


class Machine:
    """A graph that carries out what it is asked, or refuses with a sentence."""

    def __init__(self, *, missing: str = "", refusal: str = "", unrecorded: str = "") -> None:
        self.missing, self.refusal = missing, refusal
        self._unrecorded = unrecorded
        self.done: list[str] = []

    def unavailable(self, command: str) -> str:
        return self.missing

    def _carry_out(self, what: str) -> None:
        if self.refusal:
            raise CommandError(self.refusal)
        self.done.append(what)

    async def command(self, command: str) -> str:
        self._carry_out(command)
        return "done"

    def unprepared(self) -> str:
        return self.missing

    async def choice(self) -> Choice:
        return Choice(condition=Condition())

    async def prepare(self, choice: Choice, tell: Callable[[str], None]) -> str:
        tell("building")
        what = choice.condition
        own = " ".join(f"{name}={getattr(what, name):g}" for name in OWN if getattr(what, name))
        take_up = "take up" if choice.take_up else ""
        self._carry_out(f"prepare {what.case} {what.law} {own} {take_up}".strip())
        return ""

    def unrecorded(self) -> str:
        return self._unrecorded

    async def record(self, on: bool) -> str:
        self._carry_out("record" if on else "end")
        return "recording into bag" if on else "bag: 7 messages"

    async def play(self, **asked: object) -> str:
        self._carry_out(f"play {asked}")
        return ""

    async def renew(self) -> str:
        self.done.append("renew")
        return "the machine and its watchers stand at the start of a run"


NOW = 100.0  # Wall time of pages without a socket, whatever the computer is busy with [s]


class Clock:
    """A clock that goes on as a test sets it [s]."""

    now = NOW

    def __call__(self) -> float:
        return self.now


def fresh_state(reached: str = "") -> ViewState:
    """Return what is known of active nodes, and of a machine that is in a phase."""
    state = ViewState(nodes=NODES, machine="winding_rig", solver="cable_fem")
    state.health.lifecycle = dict.fromkeys(NODES, "active")
    if reached:
        phase(state, reached)
    return state


def phase(
    state: ViewState,
    text: str,
    level: Level = Level.OK,
    reason: str = "",
    *,
    now: float = NOW - 2.0,
) -> None:
    """Let the machine report its phase at a wall time [s]."""
    values = {"phase": text, "reason": reason}
    status = Status(name="winding_rig", level=level, message=text, values=values)
    state.note_statuses(now, [status])


def wound(
    state: ViewState, condition: Condition, drum: Drum | None = None, *, now: float = NOW
) -> None:
    """Let the solver report what is wound, and on which drum, at a wall time [s]."""
    values = WoundLabel.of(condition.resolved(), drum).values()
    status = Status(name="cable_fem", message="following the machine", values=values)
    state.health.note(now, [status])


def served(
    state: ViewState,
    graph: Graph,
    *,
    clock: Callable[[], float] = lambda: NOW,
    runs: Path | None = None,
    server: str = "first",
    **limits: float,
) -> Snapshots:
    """Return everything behind a page, as `winding_dashboard.__main__` puts it together."""
    kept = [OperatorLimits(**limits)]
    recipes = Recipes(runs and runs / "recipes")
    session = OperatorSession(
        state, graph, recipes, lambda: kept[-1], lambda: "12:00:00", kept.append
    )
    return Snapshots(state, session, RunList(runs), Templates().part, clock, server)


class Desk:
    """An operator with an HTTP client, who has seen the newest snapshot.

    Attributes:
        served: What is behind the page.
        graph: What is commanded.
    """

    def __init__(
        self, state: ViewState | None = None, graph: Graph | None = None, **given: Any
    ) -> None:
        self.graph = graph or Machine()
        self.served = served(state or fresh_state(), self.graph, **given)
        app = application(self.served, Templates().page(), token="", host="127.0.0.1")
        self._transport = httpx.ASGITransport(app=app)

    def request(self, method: str, path: str, **more: Any) -> httpx.Response:
        async def ask() -> httpx.Response:
            async with httpx.AsyncClient(transport=self._transport, base_url=URL) as client:
                return await client.request(method, path, **more)

        return asyncio.run(ask())

    def look(self, query: str = "") -> dict[str, Any]:
        self.served.changed()
        answer = self.request("GET", f"/snapshot{query}")
        assert answer.status_code == 200, answer.text
        return dict(answer.json())

    def ask(self, path: str, **more: Any) -> str:
        """Ask for something, as one who sees the present; return what the page shows."""
        seen = self.look()
        body = {"server": seen["server"], "sequence": seen["sequence"], **more}
        answer = self.request("POST", path, json=body)
        assert answer.status_code == 200, answer.text
        return str(answer.json()["answer"])


def at_desk(state: ViewState | None = None, machine: Machine | None = None, **given: Any) -> Desk:
    """Return a desk whose solver has reported what it is set to."""
    desk = Desk(state or fresh_state("idle"), machine, **given)
    asyncio.run(desk.served.session.learn_choice())
    return desk


def form(case: int, law: str = "linear", *, take_up: bool = False, **fields: Any) -> dict[str, Any]:
    return {"case": case, "law": law, "take_up": take_up, "fields": fields}
