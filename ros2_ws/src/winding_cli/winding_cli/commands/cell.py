"""`winding cell`: write, check and describe cell files, which `winding run` takes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from winding_cli.cell.cell_template import meaning, schema, template
from winding_cli.run.configuration import configured
from winding_cli.terminal.console import result_console
from winding_cli.terminal.output_path import check_output_file, staged
from winding_cli.terminal.refusal import refuse, refused
from winding_core.run_spec import RunSpec

cell = typer.Typer(
    help="Write, check and describe cell files, which `winding run` takes.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
)


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
    with staged(file) as place:
        place.write_text(template(), encoding="utf-8")
    print(f"{file}: change it, then winding cell check {file}")


@cell.command()
def check(file: Annotated[Path, typer.Argument(help="Cell file.")]) -> None:
    """Refuse what `winding run` would refuse, with its line, or print what the file means."""
    with refused(ValueError):
        config = configured(RunSpec.from_cell(file, {}), {})
    table = Table.grid(padding=(0, 2))
    for subject, sentence in meaning(config):
        table.add_row(subject, sentence)
    result_console().print(table, highlight=False)


@cell.command(name="schema")
def print_schema() -> None:
    """Print the JSON schema of a cell file, for editors."""
    print(json.dumps(schema(), indent=1, ensure_ascii=False))
