"""What is wound: condition and material, chosen before a run."""

from __future__ import annotations

from typing import Protocol

from nicegui import ui
from nicegui.elements.mixins.disableable_element import DisableableElement

from winding_core.cases import paper_cases
from winding_core.units import MILLIMETRE
from winding_dashboard.views.commands import Choice, CommandError, Graph
from winding_dashboard.views.condition_form import (
    FIELDS,
    LAWS,
    OWN_FIELDS,
    filled_condition,
    form_values,
    hint,
    label,
)
from winding_dashboard.views.elements import heading, question
from winding_dashboard.views.view_state import ViewState

_OWN = 0


class Say(Protocol):
    """Tells the operator a sentence."""

    def __call__(self, sentence: str, *, alarm: bool = False) -> None:
        """Show a sentence; an alarm stands out."""


class SetupPanel:
    """Condition and material of the next run.

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
            heading("Next run")
            with ui.element("div").classes("row"):
                self._case = ui.select(_cases(), label="Case", value=None).props("dense outlined")
                self._law = ui.select(
                    {law: law.replace("_", " ") for law in LAWS}, label="Material law", value=None
                ).props("dense outlined")
            with ui.element("div").classes("row own") as form:
                self._fields = {key: self._field(key) for key in OWN_FIELDS}
            form.bind_visibility_from(self._case, "value", value=_OWN)
            with (
                ui.expansion("Material, contact, span and drive").props("dense"),
                ui.element("div").classes("row own"),
            ):
                self._fields |= {key: self._field(key) for key in FIELDS if key not in OWN_FIELDS}
            self._take_up = ui.checkbox("Go on with the identified modulus").props("dense")
            with ui.element("div").classes("row"):
                self._button = ui.button("Prepare", on_click=self._ask).props(
                    "outline no-caps color=grey-9"
                )
                self._said = ui.label().classes("remark").props("role=status")
        self._dialog = question(
            "Prepare another run?",
            "The machine has already been moved. Its nodes are taken down and built anew: "
            "time begins at zero, and what this page shows of the present run is dropped.",
            keep="Keep the run",
            act="Prepare",
            do=self._prepare,
        )
        self._elements: tuple[DisableableElement, ...] = (
            self._case,
            self._law,
            self._take_up,
            self._button,
            *self._fields.values(),
        )
        self._refused = ""
        ui.timer(1.0, self._ask_choice)

    def _field(self, key: str) -> ui.number | ui.input:
        item = FIELDS[key]
        if isinstance(item.default, str):
            return ui.input(label(key), on_change=lambda: self._refuse("")).props("dense outlined")
        return ui.number(
            label(key), placeholder=hint(item), on_change=lambda: self._refuse("")
        ).props(f"dense outlined min={item.low:g} max={item.high:g} step=any")

    def update(self) -> None:
        """Enable what can be done now, or say why not."""
        reason = self._reason()
        for element in self._elements:
            element.set_enabled(not reason and not self._busy)
        if not self._busy:
            self._tell(reason or self._refused, refused=bool(not reason and self._refused))

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
            self._tell(str(error))
            return
        self._law.value = choice.condition.law
        for key, value in form_values(choice.condition).items():
            self._fields[key].value = value
        self._take_up.value = choice.take_up
        self._case.value = choice.condition.case
        self._known = True

    def _tell(self, sentence: str, *, refused: bool = False) -> None:
        self._said.set_text(sentence)
        self._said.classes(replace="remark bad" if refused else "remark")

    def _refuse(self, sentence: str) -> None:
        self._refused = sentence
        self.update()

    def _chosen(self) -> Choice | None:
        """Return what stands in the form; None when it is refused, with a notice."""
        filled = {key: field.value for key, field in self._fields.items()}
        try:
            condition = filled_condition(
                int(self._case.value or _OWN), str(self._law.value), filled
            )
        except ValueError as error:
            self._refuse(str(error))
            return None
        self._refuse("")
        return Choice(condition=condition, take_up=bool(self._take_up.value))

    async def _ask(self) -> None:
        if self._chosen() is None:
            return
        if self._state.time > 0.0:
            self._dialog.open()
        else:
            await self._prepare()

    async def _prepare(self) -> None:
        self._dialog.close()
        choice = self._chosen()
        if choice is None:
            return
        self._busy = True
        self.update()
        try:
            remark = await self._graph.prepare(choice, self._tell)
        except CommandError as error:
            self._say(f"prepare: {error}", alarm=True)
            self._refused = str(error)
        else:
            self._state.clear()
            case = choice.condition.resolved().case
            name = f"case {case.number}" if case.number else "a condition of your own"
            self._say(f"prepare: ready to wind {name}{f'; {remark}' if remark else ''}")
        finally:
            self._busy = False
            self.update()


def _cases() -> dict[int, str]:
    rows = {
        case.number: (
            f"{case.number}: cylinder {case.cylinder_diameter / MILLIMETRE:g} mm, "
            f"cable {case.cable_diameter / MILLIMETRE:g} mm, {case.weight:.2f} N"
        )
        for case in paper_cases()
    }
    return rows | {_OWN: "own condition"}
