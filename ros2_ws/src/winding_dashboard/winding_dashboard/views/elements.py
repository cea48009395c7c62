"""Elements that several panels are made of: a card's heading, a question before a grave act."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from nicegui import ui


def heading(text: str) -> ui.label:
    """Return a card's heading."""
    return ui.label(text).classes("heading").props("role=heading aria-level=2")


def question(
    title: str, text: str, *, keep: str, act: str, do: Callable[[], Awaitable[None]]
) -> ui.dialog:
    """Return a dialog that asks before something is done.

    Args:
        title: The question.
        text: What would happen.
        keep: Name of the button that leaves everything as it is; it has the focus.
        act: Name of the other button.
        do: What that one does.
    """
    with ui.dialog() as dialog, ui.card().classes("dialog"):
        ui.label(title).classes("title")
        ui.label(text)
        with ui.row():
            ui.button(keep, on_click=dialog.close).props(
                "unelevated no-caps color=grey-9 autofocus"
            )
            ui.button(act, on_click=do).props("outline no-caps color=grey-9")
    return dialog
