"""`winding run`: wind one case through the real graph and report what came out."""

import textwrap
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from winding_cli.run.configuration import configured, warn_of_slowness
from winding_cli.terminal.output_path import STANDARD_OUTPUT, print_aside
from winding_cli.terminal.record_options import Typed, spelled, with_options_of_run
from winding_cli.terminal.refusal import refused
from winding_core.parameters import Declaration, explained, option_kind
from winding_core.run_spec import OPTIONS, SECTION_OF, USUAL, RunSpec

_HEAD = """\
Usage: winding run [CELL] [OPTIONS]

Wind one case: predict, measure, correct; end with a table and a report.
CELL is a file with any of these options, which `winding cell init` writes; what
is typed wins over it.
"""


def _show_usual(wanted: bool) -> None:
    if wanted:
        declared = {key: OPTIONS[SECTION_OF[key]][key] for key in USUAL}
        print(f"{_HEAD}\n{_explained(declared)}")
        print("\nThese are the usual options; `winding run --help-all` shows all of them.")
        raise typer.Exit


def _show_all(wanted: bool) -> None:
    if wanted:
        print(_HEAD)
        print("\n\n".join(f"{name}:\n{_explained(keys)}" for name, keys in OPTIONS.items()))
        raise typer.Exit


def _explained(declared: Mapping[str, Declaration]) -> str:
    """Return options with what they mean, in two columns."""
    heads = {}
    for key, item in declared.items():
        name, kind = spelled(key), option_kind(item)
        heads[key] = f"  --[no-]{name[2:]}" if kind is bool else f"  {name} {kind.__name__.lower()}"
    indent = " " * (max(map(len, heads.values())) + 2)
    texts = {key: explained(item) for key, item in declared.items()}
    return "\n".join(
        textwrap.fill(
            texts[key], 80, initial_indent=f"{head:{len(indent)}}", subsequent_indent=indent
        )
        for key, head in heads.items()
    )


@with_options_of_run()
def run(
    typed: Typed,
    *,
    cell: Annotated[
        Path | None,
        typer.Argument(help="Cell file with any of these options, see `winding cell init`."),
    ] = None,
    help_all: Annotated[
        bool,
        typer.Option("--help-all", help="Show every option.", callback=_show_all, is_eager=True),
    ] = False,
    help_usual: Annotated[
        bool,
        typer.Option("--help", help="Show usual options.", callback=_show_usual, is_eager=True),
    ] = False,
) -> None:
    """Wind one case: predict, measure, correct; end with a table and a report."""
    from winding_cli.run.delivery import RunDelivery
    from winding_cli.run.winding import wind
    from winding_cli.terminal.origin import origin_here
    from winding_recorder.bags.description import ORIGIN

    origin = origin_here()
    with refused(ValueError):
        spec = RunSpec.from_cell(cell, typed, spelled)
        origin = replace(origin, labels=spec.labels)
        config = configured(spec, {ORIGIN: origin.text})
    if spec.path("json") == STANDARD_OUTPUT:
        print_aside()
    warn_of_slowness(config)
    delivery = RunDelivery(config, origin)
    failure = wind(config, delivery)
    if failure is not None:
        failure()
    delivery.end()
