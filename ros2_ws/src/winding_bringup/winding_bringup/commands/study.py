"""`winding study`: the paper's twelve cases with our solver, beside the paper's columns."""

from __future__ import annotations

import json as json_text
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from winding_bringup.commands.refusal import refuse

if TYPE_CHECKING:
    from rich.table import Table

    from winding_study.comparison import Comparison
    from winding_study.study import CaseResult, StudyConfig


def study(
    *,
    element: Annotated[str, typer.Option(help="Element of the solver: rod.")] = "rod",
    law: Annotated[
        str | None,
        typer.Option(help="Material law; linear, or neo_hookean with --calibrate-rig."),
    ] = None,
    segment_mm: Annotated[float, typer.Option(help="Length of an element.")] = 5.0,
    json: Annotated[Path | None, typer.Option(help="File of means and cells.")] = None,
    lengths: Annotated[
        Path | None, typer.Option(help="File of predicted lengths, as `winding train` reads them.")
    ] = None,
    processes: Annotated[int, typer.Option(min=1, help="Cases at a time.")] = 2,
    calibrate_rig: Annotated[
        bool,
        typer.Option("--calibrate-rig", help="Fit the rig's span tension to the measured angles."),
    ] = False,
) -> None:
    """Wind all twelve cases ahead and compare every measured marker."""
    from rich.console import Console

    from cable_fem_node.winding import LAWS
    from correction_node.dataset import format_lengths
    from winding_study.comparison import compare, compare_paper
    from winding_study.study import StudyConfig, predicted_lengths

    if element != "rod":
        refuse(f"element must be rod, got {element!r}")
    if not 0.0 < segment_mm < float("inf"):
        refuse(f"segment-mm must be positive and finite, got {segment_mm}")
    if law is not None and law not in LAWS:
        refuse(f"law must be one of {', '.join(LAWS)}, got {law!r}")
    for path in (json, lengths):
        if path is not None and not path.absolute().parent.is_dir():
            refuse(f"there is no folder {path.parent} for {path.name}")
    if calibrate_rig:
        if lengths is not None:
            refuse("--calibrate-rig winds nothing, so it has no --lengths")
        _calibrate(law, json)
        return
    console = Console()
    results = _wind(StudyConfig(law=law or "linear", segment_length=1e-3 * segment_mm), processes)
    try:
        own = compare(results)
    except ValueError as error:
        refuse(error)
    paper = compare_paper()
    console.print(_cells_table(own, paper))
    console.print(_means_table(own, paper))
    console.print(
        f"{sum(result.cpu_seconds for result in results):.1f} CPU seconds; energy balance open by "
        f"at most {max(result.energy_balance_pct for result in results):.2g} %; one guide "
        "distance and the dead weight for all cases, nothing fitted."
    )
    if json is not None:
        _write(json, {**own.as_json(), "paper": paper.as_json()})
    if lengths is not None:
        lengths.write_text(format_lengths(predicted_lengths(results)), encoding="utf-8")


def _write(path: Path, content: dict[str, Any]) -> None:
    path.write_text(json_text.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def _calibrate(law: str | None, json: Path | None) -> None:
    from dataclasses import asdict

    from rich.console import Console
    from rich.table import Table

    from winding_study.calibration import LAW, calibrate

    console = Console()
    with Console(stderr=True).status("fitting five numbers thirteen times"):
        fitted = calibrate(law or LAW)
    table = Table(title=f"Span tension of the rig, fitted with law {fitted.law}")
    for column in ("number", "value", "standard error"):
        table.add_column(column, justify="left" if column == "number" else "right")
    units = {"offset": " (F0), N", "diameter_gain": " (b), N", "build_up_length": " (L_c), m"}
    for (name, value), error in zip(
        asdict(fitted.tension).items(), fitted.standard_errors, strict=True
    ):
        label = name.replace("_", " ") + units.get(name, "")
        table.add_row(label, f"{value:.4f}", f"{error:.4f}")
    console.print(table)
    console.print(
        f"theta, relative rms over {len(fitted.residuals_pct)} measured markers: "
        f"{fitted.in_sample_rms_pct:.2f} % in-sample, "
        f"{fitted.leave_one_case_out_rms_pct:.2f} % leave-one-case-out. The form of the law was "
        "found on these very cells, so even the left-out number flatters it."
    )
    if json is not None:
        _write(json, {"calibration": fitted.as_json()})


def _wind(config: StudyConfig, processes: int) -> tuple[CaseResult, ...]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    from winding_study.study import wind_cases

    with Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        console=Console(stderr=True),
        transient=True,
    ) as progress:
        task = progress.add_task("winding 12 cases", total=12)

        def ended(result: CaseResult) -> None:
            progress.update(task, advance=1, description=f"case {result.case} wound")

        try:
            return wind_cases(config, ended, processes=processes)
        except ValueError as error:
            refuse(error)


def _cells_table(own: Comparison, paper: Comparison) -> Table:
    from rich.table import Table

    table = Table(title="Every measured marker: ours, the paper's simulation, the experiment")
    table.add_column("case")
    table.add_column("marker")
    for column in ("theta, rad", "z, mm", "S, mm"):
        for who in ("ours", "paper", "exp."):
            table.add_column(f"{column}\n{who}", justify="right")
    for who in ("ours", "paper"):
        table.add_column(f"error, %\n{who}", justify="right")
    for mine, theirs in zip(own.cells, paper.cells, strict=True):
        table.add_row(
            str(mine.case) if mine.marker == 1 else "",
            f"P{mine.marker}",
            *(f"{v:.2f}" for v in (mine.theta_rad, theirs.theta_rad, mine.theta_exp_rad)),
            *(f"{1e3 * v:.2f}" for v in (mine.z_m, theirs.z_m, mine.z_exp_m)),
            *(f"{1e3 * v:.1f}" for v in (mine.s_m, theirs.s_m, mine.s_exp_m)),
            f"{mine.error_pct:.2f}",
            f"{theirs.error_pct:.2f}",
        )
    return table


def _means_table(own: Comparison, paper: Comparison) -> Table:
    from rich.table import Table

    table = Table(title=f"Means over {len(own.cells)} measured markers")
    table.add_column("")
    for who in ("ours", "paper's simulation"):
        table.add_column(who, justify="right")
    for label, mine, theirs in (
        ("length error as in Table 7, %", own.mean_error_pct, paper.mean_error_pct),
        ("|z - z_exp| marker by marker, mm", own.mean_abs_dz_mm, paper.mean_abs_dz_mm),
        (
            "|z - z_exp| at the measured theta, mm",
            own.mean_abs_dz_path_mm,
            paper.mean_abs_dz_path_mm,
        ),
        ("|theta - theta_exp|, rad", own.mean_abs_dtheta_rad, paper.mean_abs_dtheta_rad),
    ):
        table.add_row(label, *("-" if v is None else f"{v:.2f}" for v in (mine, theirs)))
    return table
