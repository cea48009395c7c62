"""`winding cell`: write, check and describe cell files, which `winding run` takes."""

from __future__ import annotations

import json
import math
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
import yaml
from rich.table import Table

from winding_cli.app import command_group
from winding_cli.run.configuration import configured
from winding_cli.terminal.console import result_console
from winding_cli.terminal.output_path import STANDARD_OUTPUT, check_output_file, write_text
from winding_cli.terminal.refusal import refuse, refused
from winding_core.cable.condition import Condition
from winding_core.cable.wound_label import WoundLabel
from winding_core.parameters import (
    Declaration,
    explained,
    option_kind,
    shown_values,
    typed_declaration,
)
from winding_core.run_spec import OPTIONS, SECTIONS, USUAL, RunSpec
from winding_supervisor.session.domain_lock import chosen_domain

if TYPE_CHECKING:
    from winding_supervisor.session.run_config import RunConfig

_WIDTH = 96
_HEAD = """\
# A cell: what `winding run` winds, on which machine, and what it leaves. Names and units are those
# of the options, which win over this file. `winding cell check FILE` prints what it means.
"""
# Of options whose default is no value that can be given.
_EXAMPLES = {
    "turns": 4.0,
    "program": "lay.csv",
    "pitch_mm": 18.0,
    "weights": "paper",
    "output": "runs/left",
    "bag": "runs/left/bag",
}
_JSON_TYPES = {bool: "boolean", int: "integer", float: "number"}


def template() -> str:
    """Return a commented cell file with every usual option; all but the case are comments."""
    shown = Condition().as_typed({"case": Condition.case}) | _EXAMPLES
    lines = [_HEAD]
    for section, declared in OPTIONS.items():
        lines.append(f"{section}:")
        for key, item in declared.items():
            if key in USUAL:
                value = shown.get(key, typed_declaration(key, item).default)
                lines.append(_comment(explained(item)))
                mark = "" if key == "case" else "# "
                lines.append(f"  {mark}{key}: {yaml.safe_dump(value).splitlines()[0]}")
        further = [key for key in declared if key not in USUAL]
        if further:
            lines.append(_comment(f"Also: {', '.join(further)}."))
        lines.append("")
    return "\n".join(lines)


def _comment(text: str) -> str:
    return textwrap.indent(textwrap.fill(text, _WIDTH), "  # ")


def schema() -> dict[str, Any]:
    """Return the JSON schema of a cell file."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": "urn:cable-winding-twin:cell:1",
        "title": "Cell file of winding run",
        "type": ["object", "null"],
        "additionalProperties": False,
        "properties": {
            section: {
                "type": ["object", "null"],
                "description": (SECTIONS[section].__doc__ or "").splitlines()[0],
                "additionalProperties": False,
                "properties": {key: _property(key, item) for key, item in declared.items()},
            }
            for section, declared in OPTIONS.items()
        },
    }


def _property(key: str, item: Declaration) -> dict[str, Any]:
    typed = typed_declaration(key, item)
    limits = {
        name: value
        for name, value in (("minimum", typed.low), ("maximum", typed.high))
        if value is not None
    }
    found: dict[str, Any] = {"description": explained(item)}
    if isinstance(item.default, list):
        count = len(item.default)
        numbers = {"type": "array", "items": {"type": "number", **limits}}
        return found | numbers | {"minItems": count, "maxItems": count}
    if item.choices is not None:
        return found | {"enum": [*filter(None, item.choices)]}
    return found | {"type": _JSON_TYPES.get(option_kind(item), "string"), **limits}


def meaning(config: RunConfig) -> Iterator[tuple[str, str]]:
    """Yield what a run means: subject and sentence."""
    spec = config.spec
    what, recording = spec.condition.resolved(), spec.recording
    label, speed = WoundLabel.of(what), what.drive.angular_speed
    name = f"case {label.case}" if label.case else "an own condition"
    yield "wound", f"{name}: {label.sentence}, {speed:g} rad/s for {what.duration:g} s"
    arm = ", its guide on an arm" if spec.machine.machine_file else ""
    machine = f"simulated{arm}, its cable lies as {spec.simulated_lay}"
    if config.machine is not None:
        turns = config.machine.end_angle / (2.0 * math.pi)
        machine = f"external, begins by {spec.machine.start}, ends after {turns:.2f} turns"
    yield "machine", f"{machine}; {'with' if spec.camera.camera else 'without'} a camera"
    yield "lay", f"wanted, control {spec.lay.control}" if spec.controlled else "no lay is wanted"
    wound = spec.wound_drum
    if wound is not None:
        yield "drum", f"{len(wound.layers)} {wound.winding} layers, {wound.turns:.2f} turns"
    yield "nodes", ", ".join(node.name for node in config.graph)
    yield "graph", f"namespace /{spec.graph.namespace}, DDS domain {chosen_domain(spec.domain)}"
    yield "recorded", f"every topic into {recording.bag}" if recording.bag else "nothing"
    further = filter(None, map(spec.path, ("report", "json", "trace", "truth")))
    files = (file.absolute() for file in (config.directory, *further) if file != STANDARD_OUTPUT)
    yield "written", ", ".join(map(str, files))
    for section, declared in OPTIONS.items():
        record = getattr(spec, section)
        typed = {key: spec.given[key] for key in declared if key in spec.given}
        values = shown_values(SECTIONS[section], vars(record)) | typed
        if section == "condition":
            values = spec.condition.as_typed(typed)
        shown = (
            f"{key} {value}" for key, value in values.items() if value or declared[key].default
        )
        yield f"  {section}", ", ".join(shown)


cell = command_group(__doc__)


@cell.command()
def init(
    file: Annotated[Path, typer.Argument(help="New file; - for standard output.")] = Path(
        "cell.yaml"
    ),
) -> None:
    """Write a commented cell file with all usual options."""
    if str(file) == "-":
        print(template(), end="")
        return
    if file.exists():
        refuse(f"{file} exists already; nothing is written over it")
    check_output_file(file)
    write_text(file, template())
    print(f"{file}: change it, then winding cell check {file}")


@cell.command()
def check(file: Annotated[Path, typer.Argument(help="Cell file.")]) -> None:
    """Refuse what `winding run` would refuse, with its line, or print what the file means."""
    with refused(ValueError):
        config = configured(RunSpec.from_cell(file, {}), {})
    table = Table.grid(padding=(0, 2))
    for subject, sentence in meaning(config):
        table.add_row(subject, sentence)
    result_console().print(table)


@cell.command(name="schema")
def print_schema() -> None:
    """Print the JSON schema of a cell file, for editors."""
    print(json.dumps(schema(), indent=1, ensure_ascii=False))
