"""`winding run`: wind one case through the real graph and report what came out."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer

from winding_cli.run.configuration import configured
from winding_cli.terminal.record_options import Typed, spelled, with_options_of_run
from winding_cli.terminal.refusal import refused
from winding_core.parameters import Declaration, explained, option_kind
from winding_core.run_options import OperatorLimits
from winding_core.run_spec import OPTIONS, USUAL, RunSpec

_WIDTH = 80
_HEAD = """\
Usage: winding run [CELL] [OPTIONS]

Wind one case: predict, measure, correct; end with a table and a report.
CELL is a file with any of these options, which `winding cell init` writes; what
is typed wins over it.
"""


def _show_usual(wanted: bool) -> None:
    if wanted:
        usual = {
            key: item
            for declared in OPTIONS.values()
            for key, item in declared.items()
            if key in USUAL
        }
        print(f"{_HEAD}\n{_explained(usual)}")
        print("\nThese are the usual options; `winding run --help-all` shows all of them.")
        raise typer.Exit


def _show_all(wanted: bool) -> None:
    if wanted:
        print(f"{_HEAD}The options stand in the sections of a cell file.")
        for section, declared in OPTIONS.items():
            print(f"\n{section}:\n{_explained(declared)}")
        raise typer.Exit


def _explained(declared: Mapping[str, Declaration]) -> str:
    heads = {key: _typed_as(key, item) for key, item in declared.items()}
    column = max(map(len, heads.values())) + 4
    return "\n".join(
        textwrap.fill(
            explained(item),
            _WIDTH,
            initial_indent=f"  {heads[key]}".ljust(column),
            subsequent_indent=" " * column,
        )
        for key, item in declared.items()
    )


def _typed_as(key: str, item: Declaration) -> str:
    name, kind = spelled(key), option_kind(item)
    return f"--[no-]{name[2:]}" if kind is bool else f"{name} {kind.__name__.lower()}"


@with_options_of_run
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
    with refused(ValueError):
        wind_spec(RunSpec.from_cell(cell, typed, spelled))


def wind_spec(spec: RunSpec) -> None:
    """Wind a run, and end the command as it comes out.

    Raises:
        ParameterError: Before anything moves, of what would end the run later.
    """
    from winding_cli.run.delivery import DeliveryOptions, RunDelivery
    from winding_cli.run.winding import wind
    from winding_cli.terminal.origin import origin_here
    from winding_recorder.bags.description import ORIGIN

    origin = origin_here()
    config = configured(spec, {ORIGIN: origin.text})
    recording, limits = spec.recording, spec.given["limits"]
    report, numbers, trace = (
        Path(text) if text else None for text in (recording.report, recording.json, recording.trace)
    )
    delivery = RunDelivery(
        config,
        spec.condition,
        origin,
        DeliveryOptions(
            report=report,
            json=numbers,
            trace=trace,
            wish=spec.asked("lay"),
            limits=OperatorLimits(
                lay_tolerance=spec.limits.lay_tolerance,
                error_limit_pct=spec.limits.error_limit_pct,
            ),
            lay_held="lay_tolerance_mm" in limits,
            errors_held="error_limit_pct" in limits,
        ),
    )
    failure = wind(config, spec.condition, delivery)
    if failure is not None:
        failure()
    delivery.end()
