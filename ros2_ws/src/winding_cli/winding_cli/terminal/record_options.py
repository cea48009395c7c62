"""Options of the command line: those of several commands, and those that records declare."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from typing import Annotated, Any, get_args, get_type_hints

import typer

from winding_core.parameters import Declaration, explained, option_kind, options

Domain = Annotated[int | None, typer.Option(help="DDS domain; else ROS_DOMAIN_ID, else 0.")]
Namespace = Annotated[str, typer.Option(help="Namespace of the graph.")]

_MACHINE = "External machine"
_CAMERA = "Camera and markers"
_LAY = "Wanted lay"

# Record of parameters -> heading of the options that it declares.
PANEL_OF_RECORD = {
    "Condition": "What is wound",
    "RunParameters": "What is wound, and how it is computed",
    "MachineAxes": _MACHINE,
    "CameraClockParameters": _CAMERA,
    "MarkerParameters": _CAMERA,
    "MarkerLook": _CAMERA,
    "CameraPlacement": _CAMERA,
    "CameraPixels": _CAMERA,
    "LayParameters": _CAMERA,
    "LayWish": _LAY,
    "LayTolerance": _LAY,
    "ErrorLimit": "What is written",
    "PlanParameters": "Limits of the machine",
}


def _options_of_run() -> Iterator[tuple[str, str]]:
    for panel, names in (
        ("Simulated machine", "lay truth speed frame_rate camera_noise seed"),
        (_MACHINE, "machine camera start turns wound_length_mm standing_s"),
        ("What is written", "output report json bag compression split_mb trace"),
        ("Graph", "compose weights parameters domain namespace attach secure"),
        ("Operator's page", "dashboard dashboard_port"),
    ):
        for name in names.split():
            yield name, panel


# Option of `winding run` -> heading.
PANEL_OF_RUN = dict(_options_of_run())


# What was typed, by option without dashes, in the unit of its name.
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
