"""What a folder holds of other people's experiments, as work to be done one by one."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from winding_verification.experiments import capstan_table
from winding_verification.experiments import held_cable_comparison as held
from winding_verification.experiments.comparison import (
    EXPERIMENTS,
    compare,
    found_experiments,
)
from winding_verification.experiments.external_row import ExternalRow
from winding_verification.experiments.motion_capture import cable_folders, read_cable
from winding_verification.experiments.scenario import ExternalFileError, NothingFoundError

NAMES = (*EXPERIMENTS, held.NAME, capstan_table.NAME)


@dataclass(frozen=True, kw_only=True)
class Work:
    """One experiment.

    Attributes:
        name: What it is.
        rows: Computes it.
    """

    name: str
    rows: Callable[[], Iterable[ExternalRow]]


def found_work(folder: Path, wanted: Collection[str] = NAMES) -> tuple[list[Work], tuple[str, ...]]:
    """Return what to compute, and the names of what is there and is not computed.

    Args:
        folder: Somewhere above the files.
        wanted: Names of NAMES.

    Raises:
        NothingFoundError: The folder holds nothing of that.
        ExternalFileError: There is no such folder, or a file is no experiment.
    """
    if not folder.is_dir():
        raise ExternalFileError(f"there is no folder {folder}")
    work: list[Work] = []
    lacking = []
    others: tuple[str, ...] = ()
    scenarios = [name for name in wanted if name in EXPERIMENTS]
    if scenarios:
        try:
            files, others = found_experiments(folder, scenarios)
            work += [Work(name=file.parent.name, rows=partial(compare, file)) for file in files]
        except NothingFoundError as error:
            lacking.append(str(error))
    if held.NAME in wanted:
        cables = cable_folders(folder)
        comparison = held.HeldCableComparison()
        work += [
            Work(name=one.name, rows=partial(comparison.compare, read_cable(one))) for one in cables
        ]
        if cables:
            work.append(Work(name="all cables", rows=comparison.reached))
        else:
            lacking.append(f"{folder} holds no runs of DEFORM (CABLE/train and CABLE/eval, *.pkl)")
    if capstan_table.NAME in wanted:
        tables = sorted(folder.rglob(capstan_table.TABLE))
        work += [
            Work(name=capstan_table.NAME, rows=partial(capstan_table.compare_points, points))
            for points in map(capstan_table.read_table, tables)
        ]
        if not tables:
            lacking.append(
                f"{folder} holds no {capstan_table.TABLE}, a table with the columns "
                f"{', '.join(capstan_table.LIMITS)}"
            )
    if not work:
        raise NothingFoundError("; ".join(lacking))
    return work, others
