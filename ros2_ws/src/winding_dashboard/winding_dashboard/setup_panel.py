"""What is wound: case and material law, chosen before a run."""

from __future__ import annotations

from typing import Protocol

from nicegui import ui

from cable_winding.cases import paper_cases
from winding_dashboard.commands import CommandError, Graph
from winding_dashboard.view_state import ViewState

_MILLIMETRE = 1.0e3
_OWN = 0


class Say(Protocol):
    """Tells the operator a sentence."""

    def __call__(self, sentence: str, *, alarm: bool = False) -> None:
        """Show a sentence; an alarm stands out."""


class SetupPanel:
    """Case and material law of the next run.

    Args:
        state: Says whether the machine stands.
        graph: Is asked and set.
        say: Shows sentences.
    """

    def __init__(self, state: ViewState, graph: Graph, say: Say) -> None:
        self._state, self._graph, self._say = state, graph, say
        self._known = False
        self._busy = False
        with ui.element("section").classes("card setup").props('aria-label="Next run"'):
            ui.label("Next run").classes("heading").props("role=heading aria-level=2")
            with ui.element("div").classes("row"):
                self._case = ui.select(_cases(), label="Case", value=None).props("dense outlined")
                self._law = ui.select({}, label="Material law", value=None).props("dense outlined")
            with ui.element("div").classes("row"):
                self._button = ui.button("Prepare", on_click=self._ask).props(
                    "outline no-caps color=grey-9"
                )
                self._said = ui.label().classes("remark").props("role=status")
        with ui.dialog() as self._dialog, ui.card().classes("dialog"):
            ui.label("Prepare another run?").classes("title")
            ui.label(
                "The machine has already been moved. Its nodes are taken down and built anew: "
                "time begins at zero, and what this page shows of the present run is dropped."
            )
            with ui.row():
                ui.button("Keep the run", on_click=self._dialog.close).props(
                    "unelevated no-caps color=grey-9 autofocus"
                )
                ui.button("Prepare", on_click=self._prepare).props("outline no-caps color=grey-9")
        ui.timer(1.0, self._ask_choice)

    def update(self) -> None:
        """Enable what can be done now, or say why not."""
        reason = self._reason()
        for element in (self._case, self._law, self._button):
            element.set_enabled(not reason and not self._busy)
        if not self._busy:
            self._said.set_text(reason)

    def _reason(self) -> str:
        missing = self._graph.unprepared()
        if missing:
            return f"cannot be chosen here: {missing}"
        if self._state.phase in ("winding", "stopping"):
            return f"cannot be chosen while the machine is {self._state.phase}"
        if not self._known:
            return "asking the solver what it is set to"
        return ""

    async def _ask_choice(self) -> None:
        if self._known or self._graph.unprepared():
            return
        try:
            choice = await self._graph.choice()
        except CommandError as error:
            self._said.set_text(str(error))
            return
        self._law.set_options({law: law.replace("_", " ") for law in choice.laws}, value=choice.law)
        # A condition of one's own stays out of the list unless it is what is set.
        options = _cases() | ({_OWN: "own condition"} if choice.case == _OWN else {})
        self._case.set_options(options, value=choice.case)
        self._known = True

    def _tell(self, sentence: str) -> None:
        self._said.set_text(sentence)

    async def _ask(self) -> None:
        if self._state.time > 0.0:
            self._dialog.open()
        else:
            await self._prepare()

    async def _prepare(self) -> None:
        self._dialog.close()
        case, law = int(self._case.value or 0), str(self._law.value)
        self._busy = True
        self.update()
        try:
            await self._graph.prepare(case, law, self._tell)
        except CommandError as error:
            self._say(f"prepare: {error}", alarm=True)
        else:
            self._state.clear()
            self._say(f"prepare: ready to wind case {case}")
        finally:
            self._busy = False
            self.update()


def _cases() -> dict[int, str]:
    return {
        case.number: (
            f"{case.number}: cylinder {case.cylinder_diameter * _MILLIMETRE:g} mm, "
            f"cable {case.cable_diameter * _MILLIMETRE:g} mm, {case.weight:.2f} N"
        )
        for case in paper_cases()
    }
