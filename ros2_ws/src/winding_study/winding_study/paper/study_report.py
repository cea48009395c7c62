"""The study's report: one HTML file beside one CSV file for every table."""

from dataclasses import replace
from pathlib import Path

from correction_node.training.comparison import RIG_PROCESS
from correction_node.training.training import LEARNERS, RIG
from winding_core.cable.cases import paper_case
from winding_core.machine.drive import PAPER_DURATION, DriveProfile
from winding_reports.documents.page import PAGE, Tile, render_page
from winding_reports.documents.picture import Picture
from winding_reports.records.identity import Identity, condition_texts
from winding_reports.records.run_record import AxisSpeeds, Signal
from winding_reports.run_report.cable_pictures import cables_picture
from winding_reports.run_report.machine_pictures import speeds_picture
from winding_rig_node.machine.machine import axis_trial
from winding_rig_node.machine.machine_config import MachineConfig
from winding_study.paper.case_result import cable_of
from winding_study.paper.study_pictures import (
    errors_picture,
    models_picture,
    neighbours_picture,
    network_picture,
    stretches_picture,
)
from winding_study.paper.study_record import PHYSICAL, StudyRecord
from winding_study.run_store import solver_version

_TEMPLATE = "study.html.j2"
_PACKAGE = "winding_study"
_FACTS = "How the study was made"


def write_study(
    record: StudyRecord, directory: Path, *, stored: int = 0, identity: Identity | None = None
) -> Path:
    """Write page and CSV files and return the path of the page; missing folders are made.

    Args:
        record: What was found.
        directory: Where to; files of an earlier report there are replaced.
        stored: How many of its cases were in the store.
        identity: Which study it was.

    Raises:
        OSError: The folder cannot be written.
    """
    text = render_study(record, stored=stored, identity=identity)
    directory.mkdir(parents=True, exist_ok=True)
    for table in (*record.paper_tables(), *record.own_tables()):
        (directory / f"{table.name}.csv").write_text(table.as_csv(), encoding="utf-8")
    page = directory / PAGE
    page.write_text(text, encoding="utf-8")
    return page


def render_study(record: StudyRecord, *, stored: int = 0, identity: Identity | None = None) -> str:
    """Return the report as one HTML text that loads nothing from anywhere."""
    identified = {} if identity is None else identity.texts() | condition_texts(identity.condition)
    pictures = _pictures(record)
    models = models_picture(record) if record.models else None
    neighbours = None if record.noise is None else neighbours_picture(record.noise)
    own = {table.name: table for table in record.own_tables()}
    tables = record.paper_tables()
    learned = [] if models is None else [models.title, own["models"].title, own["weights"].title]
    contents = [
        *(["This study"] if identified else []),
        *(picture.title for picture in pictures["cells"]),
        *learned,
        *([own["within_run"].title] if "within_run" in own else []),
        *(picture.title for picture in pictures["figures"]),
        *([] if neighbours is None else [neighbours.title]),
        *(table.title for table in tables),
        "What these numbers are worth",
        _FACTS,
    ]
    cases = ", ".join(str(number) for number in record.cases)
    return render_page(
        _TEMPLATE,
        package=_PACKAGE,
        title="The paper's twelve cases" if len(record.cases) == 12 else f"Case {cases}",
        verdict=record.verdict(),
        conditions={},
        tiles=_tiles(record),
        pictures=pictures,
        models_picture=models,
        neighbours_picture=neighbours,
        own=own,
        tables=tables,
        contents=contents,
        identity=identified,
        facts_title=_FACTS,
        models=record.models,
        notes=_notes(record),
        facts=_facts(record, stored),
    )


def _pictures(record: StudyRecord) -> dict[str, list[Picture]]:
    duration = PAPER_DURATION if record.config is None else record.config.duration
    drawn = speeds_picture(machine_speeds(record.cases[0], duration))
    caption = f"The simulated machine, without cable and camera. {drawn.caption}"
    machine = replace(drawn, title="Figure 7: the speeds", caption=caption)
    cables = [cables_picture([*map(cable_of, record.results)])] if record.results else []
    return {
        "cells": [errors_picture(record), stretches_picture(record)],
        "figures": [machine, *cables, network_picture()],
    }


def _tiles(record: StudyRecord) -> list[Tile]:
    tiles = [_tile("Paper's simulation", record.paper.mean_error_pct, "nothing learned")]
    if record.config is not None:
        name = record.who[0].upper() + record.who[1:]
        tiles.append(_tile(name, record.comparison.mean_error_pct, "nothing learned"))
    tiles.append(_tile("Paper's network", record.paper_updated_pct(), "in-sample, as printed"))
    best = record.best_learned
    if best is not None:
        model = record.models[best]
        tiles.append(_tile("Best learned model", model.in_sample_pct, "in-sample"))
        tiles.append(_tile("Best learned model", model.leave_one_case_out_pct, "its case left out"))
    cells = record.comparison.cells
    cases = len({cell.case for cell in cells})
    return [*tiles, Tile(label="Lengths", value=str(len(cells)), remark=f"of {cases} cases")]


def _tile(label: str, error_pct: float, remark: str) -> Tile:
    return Tile(label=label, value=f"{error_pct:.2f} %", remark=remark)


def _notes(record: StudyRecord) -> list[str]:
    if record.config is None:
        first = (
            "The base is the paper's own simulation column as printed, its outliers in cases 3 "
            "and 11 included."
        )
    else:
        first = (
            "Nothing in our prediction was fitted to a case: one guide distance and the dead "
            "weight for all. The paper does not print the guide's distance; it was taken from "
            "the measured positions of all cases together."
        )
    notes = [
        first,
        "The experiment's repetitions were not published: every cell is one number, without its "
        "scatter.",
    ]
    if record.models:
        notes.append(
            "In-sample errors only show how well a model repeats its training data. Twelve cases "
            "are few: the order of models that differ by some tenths of a percent may be chance, "
            "and the forms of the models were chosen by people who had seen these cells."
        )
    best = record.best_learned
    learner = LEARNERS.get(RIG if best == RIG_PROCESS else best or "")
    if learner is not None:
        notes.append(f"The best learned model, '{best}': {learner.selection}")
    if best in PHYSICAL:
        notes.append(
            "That model predicts the length from the rig's physics and does not look at S_FEM: h "
            "only turns one into the other, so its error hardly depends on what is corrected."
        )
    return notes


def _facts(record: StudyRecord, stored: int) -> dict[str, str]:
    if record.config is None:
        return {"Base": "the paper's simulation column, as printed"}
    cpu = sum(result.cpu_seconds for result in record.results)
    return {
        "Processor time": f"{cpu:.1f} s for {len(record.results)} cases",
        "From the store": f"{stored} of {len(record.results)} cases",
        "Energy balance": "open by at most "
        f"{max(result.energy_balance_pct for result in record.results):.2g} %",
        "Solver": solver_version(),
    }


def machine_speeds(case: int, duration: float) -> AxisSpeeds:
    """Drive the simulated machine through a run [s] of a case of Table 1, without a graph."""
    drive = DriveProfile()
    config = MachineConfig(case=paper_case(case), drive=drive, duration=duration)
    t, _, cylinder, _, carriage, _, wanted_cylinder, _, wanted_carriage = axis_trial(config).T
    return AxisSpeeds(
        drive=drive,
        cylinder_speed=Signal(t=t, value=cylinder),
        carriage_speed=Signal(t=t, value=carriage),
        cylinder_setpoint=Signal(t=t, value=wanted_cylinder),
        carriage_setpoint=Signal(t=t, value=wanted_carriage),
    )
