"""Options of the command line: those of several commands, and those that records declare."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from winding_core.catalogue.cables import CableError, with_cable
from winding_core.parameters import Declaration, explained, option_kind, options
from winding_core.run_spec import OPTIONS

Domain = Annotated[int | None, typer.Option(help="DDS domain; else ROS_DOMAIN_ID, else 0.")]
Namespace = Annotated[str, typer.Option(help="Namespace of the graph.")]
Cable = Annotated[
    str | None,
    typer.Option(
        help="Cable of the library, by its name, or a cable file; see `winding cable list`.",
        rich_help_panel="What is wound",
    ),
]
Library = Annotated[
    Path | None,
    typer.Option(
        help="Folder of own cables; otherwise the user's.", rich_help_panel="What is wound"
    ),
]

_CAMERA = "Camera and markers"

# Record of parameters -> heading of the options that it declares.
PANEL_OF_RECORD = {
    "Condition": "What is wound",
    "RunParameters": "What is wound, and how it is computed",
    "MachineAxes": "External machine",
    "CameraClockParameters": _CAMERA,
    "MarkerParameters": _CAMERA,
    "MarkerLook": _CAMERA,
    "CameraPlacement": _CAMERA,
    "CameraPixels": _CAMERA,
    "LayTolerance": "Wanted lay",
    "ErrorLimit": "What is written",
    "PlanParameters": "Limits of the machine",
    "RigPrior": "Rig, as known before",
    "DrumPlanParameters": "Drum",
}


Typed = Mapping[str, object]  # What was typed, by option without dashes, in the unit of its name


def spelled(option: str) -> str:
    """Return how an option is typed."""
    return f"--{option.replace('_', '-')}"


def typed_with_cable(typed: Typed, cable: str | None, library: Path | None) -> Typed:
    """Return options of what is wound with those of a cable where nothing else was typed.

    Raises:
        CableError: There is no such cable.
    """
    if library is not None and not library.is_dir():
        raise CableError(f"--library: there is no folder of cables {library}")
    found = with_cable({**typed, "cable": cable}, library)
    return {key: value for key, value in found.items() if key != "cable"}


def with_options(*records: type) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Let a command take the options that records declare.

    Args:
        records: Declare parameters. The command takes what was typed of each, without what was
            not typed, as its first arguments; its other arguments stay as they are.
    """
    return with_declared(*map(_annotated, records))


def with_options_of_run(*records: type) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Let a command take every option of a run, as one argument, and those of further records."""
    of_run = {
        key: _annotation(key, item)
        for declared in OPTIONS.values()
        for key, item in declared.items()
    }
    return with_declared(of_run, *map(_annotated, records))


def _annotated(record: type) -> dict[str, Any]:
    panel = PANEL_OF_RECORD.get(record.__name__)
    return {key: _annotation(key, item, panel) for key, item in options(record).items()}


def with_declared(
    *groups: Mapping[str, Any],
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Let a command take declared options.

    Args:
        groups: Option -> annotation. What was typed of each group is one argument of the command.
    """

    def wrap(command: Callable[..., None]) -> Callable[..., None]:
        own = list(inspect.signature(command).parameters.values())
        firsts, rest = own[: len(groups)], own[len(groups) :]
        hints = get_type_hints(command, include_extras=True)
        taken = {
            first.name: [
                inspect.Parameter(
                    key, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=annotation
                )
                for key, annotation in group.items()
            ]
            for first, group in zip(firsts, groups, strict=True)
        }
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


def _annotation(key: str, item: Declaration, panel: str | None = None) -> Any:
    kind = option_kind(item)
    name = spelled(key)
    names = (f"{name}/--no-{name[2:]}",) if kind is bool else (name,)
    option = typer.Option(*names, help=explained(item), rich_help_panel=panel)
    return Annotated[kind | None, option]
