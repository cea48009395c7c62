"""A user's own runs as measured cells: a table, a run's folder, or a folder of such."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from correction_node.models.dataset import DataSet, LengthCell
from winding_core.cable.cases import Case, Material
from winding_core.run_outcome import Verdict

# SI units, as their names say; `cable` names the cable and may be left out.
OWN_COLUMNS = (
    "run", "marker", "cylinder_diameter_m", "cable_diameter_m", "weight_n", "marker_spacing_m",
    "young_pa", "s_fem_m", "theta_rad", "z_m",
)  # fmt: skip
SIGMAS = ("sigma_theta", "sigma_z")  # [rad], [m]; 0 where they are left out
# No physics is off by more; swapped columns and mixed units are.
MOST_OFF = 0.5
FEWEST_RUNS = 3
_FIT = (Verdict.GOOD.value, Verdict.NOT_GOOD.value)
# A run: its name, its cable, and (case, marker, s_fem, s_exp, relative sigma) of each marker.
_Reading = tuple[Case, int, float, float, float]


def load_own_runs(path: Path) -> DataSet:
    """Return the cells of own runs; `case` numbers the runs.

    Args:
        path: CSV with OWN_COLUMNS, a run's folder with run.json, or a folder of such folders.

    Raises:
        ValueError: A run cannot be learned from, or they are too few; one sentence.
    """
    runs = list(_of_table(path) if path.is_file() else _of_folders(path))
    if len(runs) < FEWEST_RUNS:
        raise ValueError(f"{path} has {len(runs)} runs: at least {FEWEST_RUNS} are needed")
    seen: dict[tuple[float, ...], str] = {}
    cells = []
    for number, (run, cable, readings) in enumerate(runs, start=1):
        measured = tuple(reading[3] for reading in readings)
        if measured in seen:
            raise ValueError(
                f"run {run} measures exactly what run {seen[measured]} does: one of them is a copy"
            )
        seen[measured] = run
        for case, marker, s_fem, s_exp, sigma in readings:
            _check(run, case, marker, s_fem, s_exp)
            cells.append(
                LengthCell(
                    case=number,
                    marker=marker,
                    cylinder_diameter=case.cylinder_diameter,
                    cable_diameter=case.cable_diameter,
                    tension=case.nominal_stress,
                    original_length=case.original_length(marker),
                    s_fem=s_fem,
                    young=case.material.young,
                    s_exp=s_exp,
                    sigma=sigma,
                    cable=cable,
                )
            )
    return DataSet(name=path.name, cells=tuple(cells), own=True)


def is_own(path: Path) -> bool:
    """Return whether a data set is one of own runs: a folder, or a table with a column run."""
    if not path.is_file():
        return path.is_dir()
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        return "run" in file.readline().strip().split(",")


def _check(run: str, case: Case, marker: int, s_fem: float, s_exp: float) -> None:
    for name, value in (("predicted", s_fem), ("measured", s_exp)):
        if not (math.isfinite(value) and value > 0.0):
            raise ValueError(
                f"run {run} marker {marker}: the {name} length must be positive, got {value} m"
            )
        if not 1.0 - MOST_OFF < value / case.original_length(marker) < 4.0:
            raise ValueError(
                f"run {run} marker {marker}: a {name} length of {value:.4g} m is not that of "
                f"{case.original_length(marker):.4g} m of cable: "
                "are units mixed or columns swapped?"
            )
    if abs(math.log(s_exp / s_fem)) > MOST_OFF:
        raise ValueError(
            f"run {run} marker {marker}: measured {s_exp:.4g} m against predicted {s_fem:.4g} m: "
            "are units mixed or columns swapped?"
        )


def _of_table(path: Path) -> Iterator[tuple[str, str, list[_Reading]]]:
    rows = list(csv.DictReader(path.read_text(encoding="utf-8-sig").splitlines()))
    missing = [name for name in OWN_COLUMNS if not rows or name not in rows[0]]
    if missing:
        raise ValueError(
            f"{path.name} has no column {missing[0]}; it needs {', '.join(OWN_COLUMNS)}"
        )
    found: dict[str, tuple[str, list[_Reading]]] = {}
    for line, row in enumerate(rows, start=2):
        try:
            numbers = {name: float(row[name]) for name in OWN_COLUMNS[1:]}
            sigma_theta, sigma_z = (float(row.get(name) or 0.0) for name in SIGMAS)
        except (TypeError, ValueError) as error:
            raise ValueError(
                f"{path.name} line {line} has a cell that is no number: {error}"
            ) from error
        strange = [name for name, value in numbers.items() if not math.isfinite(value)]
        if strange:
            raise ValueError(
                f"{path.name} line {line}: {strange[0]} must be finite, got {numbers[strange[0]]}"
            )
        marker = int(numbers["marker"])
        if marker != numbers["marker"] or marker < 1:
            raise ValueError(
                f"{path.name} line {line}: marker must be 1, 2, .., got {row['marker']}"
            )
        case = Case(
            cylinder_diameter=numbers["cylinder_diameter_m"],
            cable_diameter=numbers["cable_diameter_m"],
            weight=numbers["weight_n"],
            marker_spacing=numbers["marker_spacing_m"],
            material=Material(young=numbers["young_pa"]),
        )
        if not case.cable_diameter < case.cylinder_diameter < 10.0 or case.material.young < 1.0e4:
            raise ValueError(
                f"{path.name} line {line}: a cable of {case.cable_diameter:g} m and "
                f"{case.material.young:g} Pa on {case.cylinder_diameter:g} m: "
                "are units mixed or columns swapped?"
            )
        rho = case.centreline_radius
        s = math.hypot(rho * numbers["theta_rad"], numbers["z_m"])
        sigma = math.hypot(rho * sigma_theta, sigma_z * numbers["z_m"] / s) / s if s else 0.0
        cable, readings = found.setdefault(row["run"], (row.get("cable") or _cable(case), []))
        if any(marker == other for _, other, *_ in readings):
            raise ValueError(
                f"{path.name} line {line}: run {row['run']} marker {marker} stands twice"
            )
        readings.append((case, marker, numbers["s_fem_m"], s, sigma))
    for run, (cable, readings) in found.items():
        yield run, cable, readings


def _of_folders(path: Path) -> Iterator[tuple[str, str, list[_Reading]]]:
    if not path.is_dir():
        raise FileNotFoundError(
            f"no data set {path}: give paper, rod, a CSV file or a folder of runs"
        )
    files = (
        [path / "run.json"] if (path / "run.json").is_file() else sorted(path.glob("*/run.json"))
    )
    for file in files:
        run = file.parent.name
        try:
            record = json.loads(file.read_text(encoding="utf-8"))
            verdict, complete = record["outcome"]["verdict"], record["outcome"]["complete"]
            what = {name: item["value"] for name, item in record["identity"]["condition"].items()}
            rows = [row for row in record["markers"] if row["s_fem_m"] and row["s_tracked_m"]]
            case = _case(what)
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"run {run} has no record to learn from: {error!r}") from error
        if not complete or verdict not in _FIT:
            raise ValueError(f"run {run} is {verdict}: {'; '.join(record['outcome']['sentences'])}")
        if not rows:
            raise ValueError(f"run {run} has no marker with a predicted and a measured length")
        yield (
            run,
            _cable(case),
            [(case, row["id"], row["s_fem_m"], row["s_tracked_m"], 0.0) for row in rows],
        )


def _case(what: Mapping[str, Any]) -> Case:
    return Case(
        cylinder_diameter=1.0e-3 * what["cylinder_diameter_mm"],
        cable_diameter=1.0e-3 * what["cable_diameter_mm"],
        weight=what["tension_n"],
        marker_spacing=1.0e-3 * what["marker_spacing_mm"],
        marker_count=what["markers"],
        material=Material(young=1.0e6 * what["young_mpa"]),
    )


def _cable(case: Case) -> str:
    return f"{1e3 * case.cable_diameter:g} mm, {1e-6 * case.material.young:g} MPa"
