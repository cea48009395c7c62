"""The controller of the lay: picture, turns, what it does and rests on, and its switches."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from nicegui import ui

from winding_core.lay_control_records import ControlMode
from winding_core.lay_errors import TurnError, turn_errors
from winding_core.lay_tolerance import judge, turn_state
from winding_core.units import MILLIMETRE
from winding_dashboard.views import commands
from winding_dashboard.views.commands import Graph
from winding_dashboard.views.control_chart import ControlChart
from winding_dashboard.views.control_words import basis_words, beliefs, mode_words
from winding_dashboard.views.elements import heading, question
from winding_dashboard.views.panels import number
from winding_dashboard.views.view_state import ViewState

_PER_METRE = 1.0 / MILLIMETRE
# The newest turns stand in the table.
_ROWS = 6
_COLUMNS = ("Turn", "Wanted z, mm", "Measured z, mm", "Error, mm", "Largest, mm", "")
# While the machine does one of these, its carriage must be somebody's.
_GOING = ("winding", "stopping")
_STYLES = {"off": "bad", "partly seen": "warn"}
_TITLES = {ControlMode.OFF: "Off", ControlMode.WATCH: "Watch", ControlMode.DRIVE: "Drive"}


class ControlPanel:
    """What the controller of the lay does; there once a controller was heard.

    Args:
        state: What it says.
        graph: Is asked to switch it.
        do: Does something and tells the operator what came of it.
    """

    def __init__(
        self,
        state: ViewState,
        graph: Graph,
        do: Callable[[str, Awaitable[str]], Awaitable[bool]],
    ) -> None:
        self._state, self._graph, self._do = state, graph, do
        self._busy = False
        self._style = ""
        self._marked: ControlMode | None = None
        self._shown: tuple[float, int, float] = (float("nan"), 0, 0.0)
        with (
            ui.element("section").classes("card control").props('aria-label="Lay control"') as card
        ):
            self._card = card
            with ui.element("div").classes("picture"):
                with ui.element("div").classes("heading-row"):
                    heading("Lay control: wanted, predicted and measured lay")
                    limit = f"{state.lay_tolerance * _PER_METRE:g}"
                    ui.label(f"band: ± {limit} mm from turn 3 on").classes("remark")
                self._chart = ControlChart(state.lay_tolerance)
            with ui.element("div").classes("words"):
                self._switches()
                self._basis = ui.label().props("role=status")
                self._facts = _Facts()
                self._table()
                self._verdict = ui.label().classes("remark").props("role=status")
        card.set_visibility(False)
        self._leave = {mode: self._leaving(mode) for mode in (ControlMode.OFF, ControlMode.WATCH)}
        self._take = question(
            "Let the controller drive the machine?",
            "It commands the carriage, and the brake where there is one, from where they are. "
            "The cylinder goes on as it was told.",
            keep="Leave it",
            act="Drive",
            do=lambda: self._answered(ControlMode.DRIVE),
        )

    def update(self) -> None:
        """Show the state, and enable what can be done now."""
        state = self._state
        control = state.control
        self._card.set_visibility(control.known)
        if not control.known:
            return
        self._mode.set_text(mode_words(control.mode))
        for mode, button in self._buttons.items():
            reason = self._graph.unavailable(commands.LAY_CONTROL[mode])
            # What plays a recording has nothing that could be switched.
            button.set_visibility(not reason)
            button.set_enabled(not reason and not self._busy)
        self._mark(control.mode)
        text, fallen = basis_words(control, state.time)
        self._basis.set_text(text)
        style = "basis warn" if fallen else "basis"
        if style != self._style:
            self._basis.classes(replace=style)
            self._style = style
        self._facts.update(beliefs(control))
        self._chart.update(state)
        self._update_turns()

    def _mark(self, mode: ControlMode | None) -> None:
        """Fill the switch of the present mode."""
        if mode is self._marked:
            return
        self._marked = mode
        for own, button in self._buttons.items():
            filled, empty = "unelevated text-color=white aria-pressed=true", "outline"
            if own is mode:
                button.props(remove=empty, add=filled)
            else:
                button.props(remove=filled, add=empty)

    def _update_turns(self) -> None:
        state = self._state
        shown = (state.lay_time, len(state.lay), state.control.time)
        if shown == self._shown:
            return
        self._shown = shown
        wanted = state.control.wanted
        turns = turn_errors(state.lay, wanted)
        newest = turns[-_ROWS:]
        for index, line in enumerate(self._lines):
            line.update(newest[index] if index < len(newest) else None, state.lay_tolerance)
        verdict = judge(turns, state.lay_tolerance, wanted.end)
        self._verdict.set_text(f"{verdict.sentence}.")

    def _switches(self) -> None:
        with ui.element("div").classes("mode-row"):
            self._mode = ui.label().classes("heading").props("role=status aria-label=mode")
            with ui.element("div").classes("modes"):
                self._buttons = {mode: self._button(mode) for mode in ControlMode}

    def _button(self, mode: ControlMode) -> ui.button:
        async def click() -> None:
            await self._ask(mode)

        return ui.button(_TITLES[mode], on_click=click).props("outline no-caps dense color=grey-9")

    def _leaving(self, mode: ControlMode) -> ui.dialog:
        return question(
            "Take the carriage from the controller?",
            "The machine winds. The carriage goes on at the drive programme's advance from where "
            "it is; the lay is not controlled from then on.",
            keep="Go on driving",
            act=f"Switch to {_TITLES[mode].lower()}",
            do=lambda: self._answered(mode),
        )

    def _table(self) -> None:
        with ui.element("table").classes("plain turns"):
            with ui.element("thead"), ui.element("tr"):
                for title in _COLUMNS:
                    with ui.element("th").props("scope=col"):
                        ui.label(title)
            with ui.element("tbody"):
                self._lines = [_TurnLine() for _ in range(_ROWS)]
        ui.label("z and error are means over the turn; largest is the place farthest off").classes(
            "remark"
        )

    async def _ask(self, mode: ControlMode) -> None:
        if mode is self._state.control.mode:
            return
        going = self._state.phase in _GOING or self._state.moving
        if mode is ControlMode.DRIVE:
            self._take.open()
        elif self._state.control.mode is ControlMode.DRIVE and going:
            self._leave[mode].open()
        else:
            await self._switch(mode)

    async def _answered(self, mode: ControlMode) -> None:
        for dialog in (self._take, *self._leave.values()):
            dialog.close()
        await self._switch(mode)

    async def _switch(self, mode: ControlMode) -> None:
        self._busy = True
        self.update()
        try:
            await self._do("lay control", self._graph.command(commands.LAY_CONTROL[mode]))
        finally:
            self._busy = False
            self.update()


class _Facts:
    def __init__(self) -> None:
        self._values: dict[str, ui.label] = {}
        self._place = ui.element("dl").classes("facts")

    def update(self, facts: dict[str, str]) -> None:
        for name, value in facts.items():
            if name not in self._values:
                with self._place, ui.element("div"):
                    with ui.element("dt"):
                        ui.label(name).classes("remark")
                    with ui.element("dd"):
                        self._values[name] = ui.label()
            self._values[name].set_text(value)


class _TurnLine:
    def __init__(self) -> None:
        with ui.element("tr") as self._line:
            self._cells = []
            for _ in _COLUMNS:
                with ui.element("td"):
                    self._cells.append(ui.label())
        self._style = ""

    def update(self, turn: TurnError | None, tolerance: float) -> None:
        self._line.set_visibility(turn is not None)
        if turn is None:
            return
        state = turn_state(turn, tolerance)
        texts = (
            str(turn.number),
            number(turn.wanted_z, 2, _PER_METRE),
            number(turn.measured_z, 2, _PER_METRE),
            number(turn.mean, 2, _PER_METRE, sign=True),
            number(turn.largest, 2, _PER_METRE, sign=True),
            state,
        )
        for cell, text in zip(self._cells, texts, strict=True):
            cell.set_text(text)
        style = _STYLES.get(state, "quiet")
        if style != self._style:
            self._cells[-1].classes(replace=style)
            self._style = style
