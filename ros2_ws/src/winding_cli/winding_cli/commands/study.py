"""`winding study`: the paper's tables and figures again, with our solver or the paper's own."""

from __future__ import annotations

import re
import sys
import time
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from winding_cli.terminal.console import Shown, busy, record_table, result_console
from winding_cli.terminal.output_path import (
    Force,
    Json,
    check_output_file,
    check_output_folder,
    staged,
    write_json,
    write_text,
)
from winding_cli.terminal.refusal import FAILED, evidence, need_extra, refuse, refused
from winding_cli.terminal.termination import end, interruptible

if TYPE_CHECKING:
    from rich.console import Console

    from winding_reports.documents.data_table import DataTable
    from winding_study.paper.case_result import CaseResult
    from winding_study.paper.study import StudyConfig
    from winding_study.paper.study_record import StudyRecord

STORE = Path("runs") / "study"
_CASES = re.compile(r"(?P<first>[0-9]{1,3})(-(?P<last>[0-9]{1,3}))?")  # A row or a range of rows


def study(
    *,
    element: Annotated[
        str, typer.Option(help="Element of the solver: rod, or solid, the paper's C3D8R.")
    ] = "rod",
    fem: Annotated[
        str, typer.Option(help="What is corrected: own predictions, or the paper's published ones.")
    ] = "own",
    cases: Annotated[
        str | None, typer.Option(help="Rows of Table 1, such as 1,4 or 7-12; all twelve.")
    ] = None,
    duration_s: Annotated[
        float, typer.Option("--duration-s", "--duration", help="Simulated seconds of a run.")
    ] = 20.0,
    law: Annotated[
        str | None, typer.Option(help="Material law; linear, or neo_hookean with --calibrate-rig.")
    ] = None,
    segment_mm: Annotated[
        float | None,
        typer.Option(help="Length of an element; rod 5, solid a sixth of the cylinder's diameter."),
    ] = None,
    mass_scaling: Annotated[
        float | None, typer.Option(help="Factor on the density; rod 1, solid 400.")
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(
            "--output", "--report", help="Folder of the page and a CSV file of every table."
        ),
    ] = None,
    json: Json = None,
    lengths: Annotated[
        Path | None, typer.Option(help="File of predicted lengths, as `winding train` reads them.")
    ] = None,
    store: Annotated[
        Path, typer.Option(help="Folder of finished runs; what is in it is not wound again.")
    ] = STORE,
    processes: Annotated[int, typer.Option(min=1, help="Cases at a time.")] = 2,
    seeds: Annotated[
        str, typer.Option(help="Seeds of the models that start at random; the spread is over them.")
    ] = "0,1,2",
    steps: Annotated[int | None, typer.Option(min=1, help="Training steps of a network.")] = None,
    models: Annotated[
        bool, typer.Option("--models/--no-models", help="Train and compare models of h.")
    ] = True,
    calibrate_rig: Annotated[
        bool,
        typer.Option("--calibrate-rig", help="Fit the rig's span tension to the measured angles."),
    ] = False,
    closed_loop: Annotated[
        bool,
        typer.Option(
            "--closed-loop",
            help="Instead: drive the guide so that the cable lands on an even helix, under hidden "
            "rigs, and print how far it lies from there beside the open loop.",
        ),
    ] = False,
    draws: Annotated[int, typer.Option(help="Hidden rigs of each case, with --closed-loop.")] = 3,
    brake: Annotated[
        bool,
        typer.Option(
            "--brake", help="A brake lands markers at angles within its reach, with --closed-loop."
        ),
    ] = False,
    force: Force = False,
) -> None:
    """Compute Tables 2 to 8 beside the paper's, every measured marker, and compare models."""
    from winding_core.cable.material_law import LAWS
    from winding_study.paper.study import StudyConfig

    with refused(ValueError):
        config = StudyConfig(
            element=element,
            law=law or "linear",
            segment_length=None if segment_mm is None else 1e-3 * segment_mm,
            mass_scaling=mass_scaling,
            duration=duration_s,
        )
    if fem not in ("own", "published"):
        refuse(f"fem must be own or published, got {fem!r}")
    if law is not None and law not in LAWS:
        refuse(f"--law must be one of {', '.join(LAWS)}, got {law!r}")
    for name, number in (
        ("duration-s", duration_s),
        ("segment-mm", segment_mm),
        ("mass-scaling", mass_scaling),
    ):
        if number is not None and not 0.0 < number < float("inf"):
            refuse(f"--{name} must be positive and finite, got {number}")
    check_output_file(json, "--json", force=force)
    check_output_file(lengths, "--lengths", force=force)
    check_output_folder(report, "--output", force=force)
    check_output_folder(store, "--store")
    if closed_loop:
        wind = evidence("closed_loop")
        if wind is None:
            refuse("closed_loop is evidence, and the package winding_verification is not installed")
        with refused(ValueError):
            wind(_cases(cases), draws, processes, json, brake=brake)
        return
    if calibrate_rig:
        if lengths is not None or report is not None:
            refuse("--calibrate-rig winds nothing, so it has no --lengths and no --output")
        _calibrate(law, json)
        return
    if fem == "published" and lengths is not None:
        refuse("--fem published winds nothing, so it has no --lengths")
    chosen, drawn = _cases(cases), _seeds(seeds)
    drawn = drawn if models else ()
    need_extra("train", "training models")
    from correction_node.models.dataset import format_lengths
    from winding_cli.terminal.origin import origin_here
    from winding_study.paper.study import predicted_lengths
    from winding_study.paper.study_record import study_identity

    record, stored = conduct(
        config if fem == "own" else None,
        chosen,
        store=store,
        processes=processes,
        seeds=drawn,
        steps=steps,
    )
    _show(record)
    identity = study_identity(record, origin_here(), drawn)
    write_json(json, {"identity": identity.as_json(), **record.as_json()})
    if lengths is not None:
        write_text(lengths, format_lengths(predicted_lengths(record.results)))
    if report is not None:
        from winding_study.paper.study_report import write_study

        with staged(report) as place:
            page = write_study(record, place, stored=stored, identity=identity)
        print(f"Report: {report / page.name}")


def _cases(text: str | None) -> tuple[int, ...]:
    """Return the rows of Table 1 that are asked for, in order."""
    from winding_core.cable.cases import published_conditions

    known = tuple(published_conditions())
    if text is None:
        return known
    found: set[int] = set()
    for part in text.split(","):
        match = _CASES.fullmatch(part.strip())
        if match is None:
            refuse(f"cases must be numbers such as 1,4 or 7-12, got {text!r}")
        first, last = int(match["first"]), int(match["last"] or match["first"])
        if not known[0] <= first <= last <= known[-1]:
            refuse(f"cases must be rows 1 to {len(known)} of Table 1, got {text!r}")
        found |= set(range(first, last + 1))
    return tuple(sorted(found))


def _seeds(text: str) -> tuple[int, ...]:
    parts = [part.strip() for part in text.split(",")]
    if not all(part.isdecimal() for part in parts) or len(set(parts)) != len(parts):
        refuse(f"seeds must be different whole numbers such as 0,1,2, got {text!r}")
    return tuple(int(part) for part in parts)


def _show(record: StudyRecord) -> None:
    """Print every cell, the means, the models and the verdict."""
    console = result_console()
    for table in (record.cells_table(), record.means_table(), *record.own_tables()):
        _print(console, table)
    results = record.results
    if results:
        console.print(
            f"{sum(result.cpu_seconds for result in results):.1f} CPU seconds; energy balance open "
            f"by at most {max(result.energy_balance_pct for result in results):.2g} %; one guide "
            "distance and the dead weight for all cases, nothing fitted."
        )
    console.print(record.verdict())


def _calibrate(law: str | None, json: Path | None) -> None:
    """Fit the rig's span tension and print it."""
    from winding_study.paper.calibration import LAW, calibrate

    console = result_console()
    with busy("fitting five numbers thirteen times"):
        fitted = calibrate(law or LAW)
    units = {"offset": " (F0), N", "diameter_gain": " (b), N", "build_up_length": " (L_c), m"}
    columns = (
        Shown("number", lambda row: row[0].replace("_", " ") + units.get(row[0], "")),
        Shown("value", lambda row: row[1], ".4f"),
        Shown("standard error", lambda row: row[2], ".4f"),
    )
    numbers = asdict(fitted.tension)
    rows = zip(numbers, numbers.values(), fitted.standard_errors, strict=True)
    title = f"Span tension of the rig, fitted with law {fitted.law}"
    console.print(record_table(columns, rows, words=1, title=title))
    console.print(
        f"theta, relative rms over {len(fitted.residuals_pct)} measured markers: "
        f"{fitted.in_sample_rms_pct:.2f} % in-sample, "
        f"{fitted.leave_one_case_out_rms_pct:.2f} % leave-one-case-out. The form of the law was "
        "found on these very cells, so even the left-out number flatters it."
    )
    write_json(json, {"calibration": fitted.as_json()})


def _print(console: Console, table: DataTable) -> None:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    means = table.mean_texts()
    shown = Table(title=table.title, box=box.SIMPLE_HEAD, show_footer=bool(means), padding=(0, 1))
    for index, (column, worded) in enumerate(zip(table.columns, table.worded, strict=True)):
        shown.add_column(
            Text(column.name.replace(": ", "\n")),
            means[index] if means else "",
            justify="left" if worded else "right",
        )
    for texts in table.texts():
        shown.add_row(*texts)
    console.print(shown)


# A file of the store that is unfinished for so long belongs to a killed process [s].
ABANDONED = 600.0


def conduct(
    config: StudyConfig | None,
    cases: tuple[int, ...],
    *,
    store: Path,
    processes: int,
    seeds: tuple[int, ...],
    steps: int | None,
) -> tuple[StudyRecord, int]:
    """Return what a study found, and how many of its cases the store had.

    Args:
        config: What to wind; None takes the paper's simulation as the base.
        cases: Rows of Table 1.
        store: Folder of finished runs.
        processes: Cases at a time.
        seeds: Of the models that start at random; none trains nothing.
        steps: Training steps of a network; None takes the usual number.
    """
    from winding_study.paper.study_record import beside_experiment, study_record

    results: tuple[CaseResult, ...] = ()
    stored = 0
    if config is not None:
        results, stored = _wind(config, cases, store, processes)
    with refused(ValueError, code=FAILED):
        comparison = beside_experiment(config, cases, results)
    try:
        with interruptible(), busy("learning") as show:
            tables = evidence("correction")
            if tables is None:
                _say(
                    "winding_verification is not installed: no tables of evidence on the correction"
                )
            record = study_record(
                config,
                cases,
                results,
                comparison,
                seeds=seeds,
                steps=steps,
                evidence=tables,
                progress=lambda text: show(description=text),
            )
    except KeyboardInterrupt:
        end("interrupted while the models were trained; what is wound is kept")
    return record, stored


def _wind(
    config: StudyConfig, cases: tuple[int, ...], folder: Path, processes: int
) -> tuple[tuple[CaseResult, ...], int]:
    from rich.progress import TimeRemainingColumn

    from winding_study.paper.study import CaseFailedError, wind_cases
    from winding_study.run_store import RunStore

    store, there = RunStore(folder), 0
    keys = _keys(config, cases)
    present = sum(store.path(key).exists() for key in keys)
    if present:
        _say(f"{present} of {len(cases)} cases are in {folder} already and are not wound again")
    shares: dict[int, float] = {}
    try:
        with (
            interruptible(),
            busy("winding", TimeRemainingColumn(), total=float(len(cases))) as show,
        ):
            folder.mkdir(parents=True, exist_ok=True)
            store.remove_unfinished(before=time.time() - ABANDONED)

            def share(number: int, done: float) -> None:
                shares[number] = done
                running = ", ".join(
                    f"{n} {100.0 * part:.0f} %" for n, part in sorted(shares.items()) if part < 1.0
                )
                show(completed=there + sum(shares.values()), description=f"case {running}")

            def resumed(result: CaseResult) -> None:
                nonlocal there
                there += 1
                show(completed=there)

            def wound(result: CaseResult) -> None:
                _say(f"case {result.case} wound: {result.cpu_seconds:.1f} CPU seconds")

            results = wind_cases(
                config, wound, cases, processes, store, resumed=resumed, share=share, say=_say
            )
            return results, there
    except KeyboardInterrupt:
        kept = sum(store.path(key).exists() for key in keys)
        end(
            f"interrupted: {kept} of {len(cases)} cases are in {folder}; the same command goes on "
            "from there"
        )
    except CaseFailedError as error:
        refuse(f"{error}; the other cases are in {folder}", FAILED)
    except OSError as error:
        refuse(f"cannot write to {folder}: {error.strerror or error}; give another --store", FAILED)


def _keys(config: StudyConfig, cases: tuple[int, ...]) -> list[str]:
    """Return the keys of all cases, so that what cannot be wound is refused before any is."""
    keys = []
    for number in cases:
        try:
            keys.append(config.key(number))
        except ValueError as error:
            refuse(f"case {number}: {error}")
    return keys


def _say(sentence: str) -> None:
    print(sentence, file=sys.stderr, flush=True)
