"""Recording on and off, and what there is of it."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from nicegui import ui

from winding_dashboard.views.commands import Graph
from winding_dashboard.views.elements import heading, question
from winding_dashboard.views.recording import recording_sentence
from winding_dashboard.views.view_state import ViewState

# While it does one of these, what is not recorded is lost.
_GOING = ("winding", "stopping")


class RecordPanel:
    """The recorder's button and its state.

    Args:
        state: Says what is being recorded.
        graph: Is asked to begin and to end.
        do: Does something and tells the operator what came of it.
        clock: Wall time [s] as the state's `health` gets it.
    """

    def __init__(
        self,
        state: ViewState,
        graph: Graph,
        do: Callable[[str, Awaitable[str]], Awaitable[bool]],
        clock: Callable[[], float],
    ) -> None:
        self._state, self._graph, self._do, self._clock = state, graph, do, clock
        self._busy = False
        with ui.element("section").classes("card setup").props('aria-label="Recording"'):
            heading("Recording")
            with ui.element("div").classes("row"):
                self._button = ui.button("Record", on_click=self._turn).props(
                    "outline no-caps color=grey-9"
                )
                self._said = ui.label().classes("remark").props("role=status")
        self._dialog = question(
            "Stop recording while the machine winds?",
            "What comes from now on is not recorded. What has been recorded stays and is "
            "closed; recording again goes into a further bag.",
            keep="Keep recording",
            act="Stop recording",
            do=self._end,
        )

    def update(self) -> None:
        """Show the state, and enable what can be done now."""
        recording = self._state.recording(self._clock())
        missing = self._graph.unrecorded()
        self._button.set_text("Stop recording" if recording.on else "Record")
        self._button.set_enabled(not missing and not self._busy)
        # A run that records by itself has a recording, and nobody who could end it.
        text = missing if missing and not recording.on else recording_sentence(recording)
        self._said.set_text(text)

    async def _turn(self) -> None:
        if not self._state.recording(self._clock()).on:
            await self._record(on=True)
        elif self._state.phase in _GOING:
            self._dialog.open()
        else:
            await self._record(on=False)

    async def _end(self) -> None:
        self._dialog.close()
        await self._record(on=False)

    async def _record(self, *, on: bool) -> None:
        self._busy = True
        self.update()
        try:
            await self._do("recording", self._graph.record(on))
        finally:
            self._busy = False
            self.update()
