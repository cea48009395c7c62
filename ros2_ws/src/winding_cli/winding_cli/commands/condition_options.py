"""Command-line options that a record of parameters declares."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Annotated, Any, get_args, get_type_hints

import typer

from winding_cli.commands.option_panels import PANEL_OF_RECORD
from winding_core.parameters import Declaration, explained, option_kind, options

# What was typed, by option without dashes, in the unit that its name says.
Typed = Mapping[str, object]


def spelled(option: str) -> str:
    """Return how an option is typed."""
    return f"--{option.replace('_', '-')}"


def with_options(
    *records: type, panels: Mapping[str, str] = MappingProxyType({})
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Let a command take the options that records declare.

    Args:
        records: Declare parameters. The command takes what was typed of each, without what was
            not typed, as its first arguments; its other arguments stay as they are.
        panels: Heading in the help of these others, by argument.
    """

    def wrap(command: Callable[..., None]) -> Callable[..., None]:
        own = list(inspect.signature(command).parameters.values())
        firsts, rest = own[: len(records)], own[len(records) :]
        hints = get_type_hints(command, include_extras=True)
        taken = {
            first.name: [
                inspect.Parameter(
                    key,
                    inspect.Parameter.KEYWORD_ONLY,
                    default=None,
                    annotation=_annotation(key, item, PANEL_OF_RECORD.get(record.__name__)),
                )
                for key, item in options(record).items()
            ]
            for first, record in zip(firsts, records, strict=True)
        }
        for name, panel in panels.items():
            (option,) = get_args(hints[name])[1:]
            option.rich_help_panel = panel
        others = [item.replace(annotation=hints[item.name]) for item in rest]

        @functools.wraps(command)
        def call(**given: Any) -> None:
            typed = {
                name: {
                    item.name: value
                    for item in items
                    if (value := given.pop(item.name)) is not None
                }
                for name, items in taken.items()
            }
            command(**typed, **given)

        added = [item for items in taken.values() for item in items]
        call.__signature__ = inspect.Signature([*added, *others])  # type: ignore[attr-defined]
        call.__annotations__ = {item.name: item.annotation for item in (*added, *others)}
        del call.__wrapped__
        return call

    return wrap


def _annotation(key: str, item: Declaration, panel: str | None) -> Any:
    kind = option_kind(item)
    name = spelled(key)
    names = (f"{name}/--no-{name[2:]}",) if kind is bool else (name,)
    option = typer.Option(*names, help=explained(item), rich_help_panel=panel)
    return Annotated[kind | None, option]
