"""The page: one column of what is, one of numbers, and the buttons always in reach."""

from __future__ import annotations

import time
from collections.abc import Awaitable, Callable
from pathlib import Path

from nicegui import ui

from winding_dashboard.views import commands
from winding_dashboard.views.charts import Charts
from winding_dashboard.views.commands import CommandError, Graph
from winding_dashboard.views.control_panel import ControlPanel
from winding_dashboard.views.elements import question
from winding_dashboard.views.palette import DANGER
from winding_dashboard.views.panels import CameraPanel, Figures, MarkerTable, NodeTable, number
from winding_dashboard.views.record_panel import RecordPanel
from winding_dashboard.views.scene import SceneView
from winding_dashboard.views.setup_panel import SetupPanel
from winding_dashboard.views.view_state import ViewState

PERIOD = 0.1
# Every how many pushes: what the eye follows is sent more often than what it reads.
_SCENE_EVERY, _CHARTS_EVERY, _SLOW_EVERY, _LAY_EVERY = 2, 4, 5, 10
_STYLE = Path(__file__).parents[1] / "data" / "page.css"
_TITLES = {
    commands.START: "Start",
    commands.STOP: "Stop",
    commands.RESET: "Reset",
    commands.EMERGENCY_STOP: "EMERGENCY STOP",
}
_OFF = "Commands are off: "
_ALARMS = ("emergency stop",)


class Page:
    """One browser's page.

    Args:
        state: What is shown.
        graph: What is commanded.
        clock: Wall time [s] as the state's `health` gets it.
    """

    def __init__(self, state: ViewState, graph: Graph, clock: Callable[[], float]) -> None:
        self._state, self._graph, self._clock = state, graph, clock
        self._marker = 0
        self._pushes = 0
        self._phase_style = ""
        ui.add_css(_STYLE)
        self._header()
        with ui.element("main").classes("board"):
            with ui.element("div").classes("left") as self._left:
                self._camera = CameraPanel()
            with ui.element("div").classes("right"):
                self._figures = Figures(state)
                self._markers = MarkerTable()
            self._middle = ui.element("div").classes("charts waiting")
            with ui.element("div").classes("below"):
                self._nodes = NodeTable()
                with ui.element("div").classes("side"):
                    self._setup = SetupPanel(state, graph, self.say)
                    self._record = RecordPanel(state, graph, self._do, clock)
        self._scene: SceneView | None = None
        self._charts: Charts | None = None
        self._control: ControlPanel | None = None
        self.update()
        ui.timer(PERIOD, self.update)
        # Figures and buttons are painted before the browser loads what draws charts and scene.
        ui.timer(0.0, self._add_drawings, once=True)

    def update(self) -> None:
        """Push what changed."""
        state = self._state
        self._update_header()
        self._camera.update(state)
        self._figures.update(state)
        self._markers.update(state)
        if self._scene and self._pushes % _SCENE_EVERY == 0:
            self._scene.update(state)
        if self._charts and self._pushes % _CHARTS_EVERY == 0:
            self._charts.update(state, self._marker)
        if self._control and self._pushes % _LAY_EVERY == 0:
            self._control.update()
        if self._pushes % _SLOW_EVERY == 0:
            self._nodes.update(state, self._clock())
            self._setup.update()
            self._record.update()
            self._update_buttons()
        self._pushes += 1

    def say(self, sentence: str, *, alarm: bool = False) -> None:
        """Show what came of the last command."""
        self._said.set_text(f"{time.strftime('%H:%M:%S')}  {sentence}")
        self._said.classes(replace="said alarm" if alarm else "said")

    def _add_drawings(self) -> None:
        with self._left:
            self._scene = SceneView()
        with self._middle.classes(remove="waiting"):
            self._control = ControlPanel(self._state, self._graph, self._do)
            self._charts = Charts(self._choose)

    def _header(self) -> None:
        with ui.element("header").classes("top"):
            ui.label("Cable winding").classes("title").props("role=heading aria-level=1")
            self._phase = ui.label().classes("phase").props("role=status aria-label=phase")
            self._recording = ui.label("recording").classes("recording")
            self._clock_label = ui.label().classes("clock")
            self._said = ui.label().classes("said").props("role=status aria-live=polite")
            with ui.element("div").classes("buttons"):
                self._buttons = {
                    commands.START: self._button(commands.START),
                    commands.STOP: self._button(commands.STOP),
                    commands.RESET: ui.button(
                        _TITLES[commands.RESET], on_click=self._ask_reset
                    ).props("outline no-caps color=grey-9"),
                    # Nothing is asked here: it acts on the click.
                    commands.EMERGENCY_STOP: self._button(commands.EMERGENCY_STOP, DANGER),
                }
        self._dialog = question(
            "Reset the machine to the start of a run?",
            "What this page shows of the present run is dropped, and solver, tracker and "
            "correction begin anew. A recording keeps what it has.",
            keep="Keep the run",
            act="Reset",
            do=self._reset,
        )

    def _button(self, command: str, colour: str = "grey-9") -> ui.button:
        async def click() -> None:
            await self._do(_TITLES[command].lower(), self._graph.command(command))

        button = ui.button(_TITLES[command], on_click=click, color=colour)
        return button.props("unelevated no-caps text-color=white").classes(
            command.replace("_", "-")
        )

    async def _do(self, what: str, work: Awaitable[str]) -> bool:
        try:
            self.say(f"{what}: {await work}")
        except CommandError as error:
            self.say(f"{what}: {error}", alarm=True)
            return False
        return True

    def _ask_reset(self) -> None:
        self._dialog.open()

    async def _reset(self) -> None:
        self._dialog.close()
        if await self._do("reset", self._graph.command(commands.RESET)):
            self._state.clear()
            await self._do("reset", self._renewed())

    async def _renewed(self) -> str:
        await self._graph.renew()
        return "the machine and its watchers stand at the start of a run"

    def _choose(self, marker: int) -> None:
        self._marker = marker

    def _update_header(self) -> None:
        state = self._state
        heard = state.heard(self._clock())
        phase = state.phase if heard else "nothing heard"
        if not phase:
            phase = "moving" if state.moving else "standing"
        style = {
            "winding": "winding",
            "moving": "winding",
            "finished": "finished",
            **dict.fromkeys(_ALARMS, "alarm"),
        }.get(phase, "still")
        self._phase.set_text(phase)
        if style != self._phase_style:
            self._phase.classes(replace=f"phase {style}")
            self._phase_style = style
        self._recording.set_visibility(state.recording(self._clock()).on)
        self._clock_label.set_text(f"{number(state.time, 1)} s")

    def _tell_missing(self) -> None:
        """Say that commands are off, unless the last command's answer stands there."""
        missing = self._graph.unavailable(commands.STOP)
        if not self._said.text or self._said.text.startswith(_OFF):
            self._said.set_text(f"{_OFF}{missing}" if missing else "")

    def _update_buttons(self) -> None:
        self._tell_missing()
        phase = self._state.phase if self._state.heard(self._clock()) else ""
        for command, button in self._buttons.items():
            reason = self._graph.unavailable(command) or commands.out_of_phase(command, phase)
            if command == commands.START:
                reason = reason or commands.asleep(self._state.health.lifecycle)
            button.set_enabled(not reason)
            text = reason or _TITLES[command]
            if button.props.get("title") != text:
                button.props["title"] = text
                button.update()
