"""A user's own runs as measured cells: a table, a run's folder, or a folder of such."""

import csv
import json
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from correction_node.models.dataset import DataSet, LengthCell
from correction_node.models.place import PAPER_PATH
from winding_core.cable.cases import Case, Material
from winding_core.run_outcome import Verdict

# SI units, as their names say; `cable` names the cable and may be left out.
OWN_COLUMNS = (
    "run", "marker", "cylinder_diameter_m", "cable_diameter_m", "weight_n", "marker_spacing_m",
    "young_pa", "s_fem_m", "theta_rad", "z_m",
)  # fmt: skip
SIGMAS = ("sigma_theta", "sigma_z")  # [rad], [m]; 0 where they are left out
# As configured in the solver [m/rad], [m]; the paper's where they are left out.
PATH = ("advance_m_per_rad", "free_length_m")
# No physics is off by more; swapped columns and mixed units are.
MOST_OFF = 0.5
FEWEST_RUNS = 3
RECORDINGS = (".mcap", ".db3")
ReadBag = Callable[[Path], Mapping[str, Any]]
_TRACKED = ("theta_tracked_rad", "z_tracked_m", "sigma_theta_rad", "sigma_z_m")
_FIT = (Verdict.GOOD.value, Verdict.NOT_GOOD.value)


class _Reading(NamedTuple):
    """A marker as it was predicted and measured."""

    case: Case
    marker: int
    s_fem: float  # [m]
    s: float  # [m]
    sigma: float = 0.0  # Of s, relative
    z: float = math.nan  # [m]
    sigma_z: float = 0.0  # [m]
    path: tuple[float, float] = PAPER_PATH


@dataclass
class _Run:
    """A run as it was found."""

    name: str
    cable: str = ""
    readings: list[_Reading] = field(default_factory=list)
    refusal: str = ""  # Why nothing is learned from it; empty if something is


def load_own_runs(path: Path, read_bag: ReadBag | None = None) -> DataSet:
    """Return the cells of own runs; `case` numbers them, `refused` has what is left out.

    Args:
        path: CSV with OWN_COLUMNS, a run's folder with run.json, a recording, or a folder of such.
        read_bag: Reads a recording as what its run.json would hold; ValueError if it cannot.

    Raises:
        ValueError: The runs that can be learned from are too few; one sentence.
    """
    seen: dict[tuple[float, ...], str] = {}
    cells: list[LengthCell] = []
    refused = []
    paths = set()
    table = path.is_file() and path.suffix not in RECORDINGS
    for run in _of_table(path) if table else _of_folders(path, read_bag):
        refusal = run.refusal or next(filter(None, map(_strange, run.readings)), "")
        measured = tuple(reading.s for reading in run.readings)
        if not refusal and measured in seen:
            refusal = f"measures exactly what run {seen[measured]} does: one of them is a copy"
        if refusal:
            refused.append(f"run {run.name} {refusal}")
            continue
        seen[measured] = run.name
        cells.extend(_cell(len(seen), run.cable, reading) for reading in run.readings)
        paths |= {tuple(round(number, 9) for number in reading.path) for reading in run.readings}
    if len(seen) < FEWEST_RUNS:
        why = "".join(f"; {sentence}" for sentence in refused)
        raise ValueError(f"{path} has {len(seen)} of {FEWEST_RUNS} runs to learn from{why}")
    named: dict[tuple[float, float], str] = {}
    for cell in cells:
        known = named.setdefault((cell.cable_diameter, cell.young), cell.cable)
        if known != cell.cable:
            raise ValueError(
                f"cables {known} and {cell.cable} are configured alike, "
                f"{_cable(cell.cable_diameter, cell.young)}: nothing "
                "tells a run with one from a run with the other; learn from one at a time, or "
                "configure the modulus of each"
            )
    (advance, free_length), *others = paths
    return DataSet(
        name=path.name,
        cells=tuple(cells),
        own=True,
        refused=tuple(refused),
        configured=None if others else (advance, free_length),
    )


def _cell(number: int, cable: str, reading: _Reading) -> LengthCell:
    return LengthCell.of(
        reading.case,
        reading.marker,
        reading.s_fem,
        case=number,
        cable=cable,
        s_exp=reading.s,
        sigma=reading.sigma,
        z_exp=reading.z,
        sigma_z=reading.sigma_z,
    )


def is_own(path: Path) -> bool:
    """Return whether a data set is one of own runs: no table, or one with a column run."""
    if not path.is_file() or path.suffix in RECORDINGS:
        return path.exists()
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        return "run" in file.readline().strip().split(",")


def _strange(reading: _Reading) -> str:
    """Return what cannot be of a reading; empty if it can."""
    case, marker, s_fem, s_exp = reading[:4]
    original = case.original_length(marker)
    for name, value in (("predicted", s_fem), ("measured", s_exp)):
        # Not of nan either.
        if not (1.0 - MOST_OFF) * original < value < 4.0 * original:
            return (
                f"marker {marker}: a {name} length of {value:.4g} m is not that of "
                f"{original:.4g} m of cable: are units mixed or columns swapped?"
            )
    if abs(math.log(s_exp / s_fem)) > MOST_OFF:
        return (
            f"marker {marker}: measured {s_exp:.4g} m against predicted {s_fem:.4g} m: "
            "are units mixed or columns swapped?"
        )
    return ""


def _of_table(path: Path) -> Iterable[_Run]:
    rows = list(csv.DictReader(path.read_text(encoding="utf-8-sig").splitlines()))
    missing = [name for name in OWN_COLUMNS if not rows or name not in rows[0]]
    if missing:
        raise ValueError(
            f"{path.name} has no column {missing[0]}; it needs {', '.join(OWN_COLUMNS)}"
        )
    found: dict[str, _Run] = {}
    for line, row in enumerate(rows, start=2):
        run = found.setdefault(row["run"], _Run(row["run"]))
        try:
            reading = _of_row(row)
            if any(reading.marker == other.marker for other in run.readings):
                raise ValueError(f"marker {reading.marker} stands twice")
        except (TypeError, ValueError) as error:
            run.refusal = run.refusal or f"line {line}: {error}"
            continue
        run.cable = row.get("cable") or _cable(
            reading.case.cable_diameter, reading.case.material.young
        )
        run.readings.append(reading)
    return found.values()


def _of_row(row: Mapping[str, str]) -> _Reading:
    numbers = {name: float(row[name]) for name in OWN_COLUMNS[1:]}
    usual = zip((*SIGMAS, *PATH), (0.0, 0.0, *PAPER_PATH), strict=True)
    numbers |= {name: float(row.get(name) or value) for name, value in usual}
    for name, value in numbers.items():
        if not math.isfinite(value):
            raise ValueError(f"{name} must be finite, got {value}")
    marker = int(numbers["marker"])
    if marker != numbers["marker"] or marker < 1:
        raise ValueError(f"marker must be 1, 2, .., got {row['marker']}")
    case = Case(
        cylinder_diameter=numbers["cylinder_diameter_m"],
        cable_diameter=numbers["cable_diameter_m"],
        weight=numbers["weight_n"],
        marker_spacing=numbers["marker_spacing_m"],
        material=Material(young=numbers["young_pa"]),
    )
    if not case.cable_diameter < case.cylinder_diameter < 10.0 or case.material.young < 1.0e4:
        raise ValueError(
            f"a cable of {case.cable_diameter:g} m and {case.material.young:g} Pa on "
            f"{case.cylinder_diameter:g} m: are units mixed or columns swapped?"
        )
    place = (numbers[name] for name in ("theta_rad", "z_m", *SIGMAS))
    path = (numbers[PATH[0]], numbers[PATH[1]])
    return _placed(case, marker, numbers["s_fem_m"], path, *place)


def _placed(
    case: Case,
    marker: int,
    s_fem: float,
    path: tuple[float, float],
    theta: float,
    z: float,
    sigma_theta: float,
    sigma_z: float,
) -> _Reading:
    rho = case.centreline_radius
    s = math.hypot(rho * theta, z)
    sigma = math.hypot(rho * sigma_theta, sigma_z * z / s) / s if s else 0.0
    return _Reading(case, marker, s_fem, s, sigma, z, sigma_z, path)


def _of_folders(path: Path, read_bag: ReadBag | None) -> Iterable[_Run]:
    places = [path] if _holds_run(path) else filter(_holds_run, sorted(path.iterdir()))
    return [_of_folder(place, read_bag) for place in places]


def _holds_run(place: Path) -> bool:
    files = ("run.json", "metadata.yaml")
    return place.suffix in RECORDINGS or any((place / name).is_file() for name in files)


def _of_folder(place: Path, read_bag: ReadBag | None) -> _Run:
    run = _Run(place.name)
    try:
        file = place / "run.json"
        if file.is_file() or read_bag is None:
            record = json.loads(file.read_text(encoding="utf-8"))
        else:
            record = read_bag(place)
        outcome = record["outcome"]
        what = {name: item["value"] for name, item in record["identity"]["condition"].items()}
        rows = [row for row in record["markers"] if row["s_fem_m"] and row["s_tracked_m"]]
        case = _case(what)
        path = _path(what)
        sentences = "; ".join(outcome["sentences"])
        if not outcome["complete"] or outcome["verdict"] not in _FIT:
            run.refusal = f"is {outcome['verdict']}: {sentences}"
        elif outcome["losses"]:
            run.refusal = f"is unhealthy: {outcome['losses'][0]}"
        elif not rows:
            run.refusal = "has no marker with a predicted and a measured length"
    except (OSError, KeyError, TypeError, ValueError) as error:
        run.refusal = f"has no record to learn from: {error!r}"
        return run
    run.cable = _cable(case.cable_diameter, case.material.young)
    run.readings = [
        _placed(case, row["id"], row["s_fem_m"], path, *(row[name] for name in _TRACKED))
        if _TRACKED[0] in row
        # Records of before places were kept.
        else _Reading(case, row["id"], row["s_fem_m"], row["s_tracked_m"], path=path)
        for row in rows
    ]
    return run


def _case(what: Mapping[str, Any]) -> Case:
    return Case(
        cylinder_diameter=1.0e-3 * what["cylinder_diameter_mm"],
        cable_diameter=1.0e-3 * what["cable_diameter_mm"],
        weight=what["tension_n"],
        marker_spacing=1.0e-3 * what["marker_spacing_mm"],
        marker_count=what["markers"],
        material=Material(young=1.0e6 * what["young_mpa"]),
    )


def _path(what: Mapping[str, Any]) -> tuple[float, float]:
    if not {"feed_speed_mm_s", "angular_speed_rad_s", "free_length_mm"} <= set(what):
        return PAPER_PATH
    advance = 1.0e-3 * what["feed_speed_mm_s"] / what["angular_speed_rad_s"]
    return advance, 1.0e-3 * what["free_length_mm"]


def _cable(diameter: float, young: float) -> str:
    return f"{1e3 * diameter:g} mm, {1e-6 * young:g} MPa"
