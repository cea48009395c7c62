"""What `winding identify` reads: tables of markers, recordings, stress-strain tables."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from winding_core.units import KILOPASCAL, MEGAPASCAL

if TYPE_CHECKING:
    from cable_fem_node.identification import Readings, TrackedRun
    from cable_fem_node.winding.run_history import Inputs
    from cable_fem_node.winding.winding_config import WindingConfig
    from winding_study.identification.tensile import TensileTest

MARKER_COLUMNS = ("marker", "theta_rad", "z_m")
_STRAIN = {"strain": 1.0, "strain_pct": 0.01}
_STRESS = {"stress_mpa": MEGAPASCAL, "stress_pa": 1.0, "stress_kpa": KILOPASCAL}


class SourceError(ValueError):
    """A source of an identification cannot be used."""


def is_recording(source: Path) -> bool:
    """Return whether a source is a bag: a folder or a storage file."""
    return source.is_dir() or source.suffix in (".mcap", ".db3")


def read_readings(path: Path) -> Readings:
    """Read a CSV with the columns marker, theta_rad, z_m and, if known, their deviations.

    Raises:
        SourceError: It cannot be read, or a column is missing or holds no number.
        IdentificationError: The markers contradict each other.
    """
    from cable_fem_node.identification import DEFAULT_SIGMA_THETA, DEFAULT_SIGMA_Z, Readings

    rows = _rows(path)
    for name in MARKER_COLUMNS:
        if name not in rows[0]:
            raise SourceError(f"{path} needs a column {name}; it has {', '.join(rows[0])}")
    numbers = [
        (
            _whole(path, i, row),
            _number(path, i, row, "theta_rad"),
            _number(path, i, row, "z_m"),
            _number(path, i, row, "sigma_theta", DEFAULT_SIGMA_THETA),
            _number(path, i, row, "sigma_z", DEFAULT_SIGMA_Z),
        )
        for i, row in enumerate(rows, start=1)
    ]
    # P0 is where everything is counted from; a table may list it all the same.
    columns = list(zip(*sorted(row for row in numbers if row[0] != 0), strict=True))
    if not columns:
        raise SourceError(f"{path} holds no marker beside P0")
    return Readings(
        ids=np.array(columns[0], dtype=np.int64),
        theta=np.array(columns[1]),
        z=np.array(columns[2]),
        sigma_theta=np.array(columns[3]),
        sigma_z=np.array(columns[4]),
    )


def read_tensile_test(path: Path) -> TensileTest:
    """Read a CSV with a column of nominal strain and one of nominal stress, units in the names.

    Raises:
        SourceError: It cannot be read, or a column is missing or holds no number.
        IdentificationError: The points are too few, negative or not finite.
    """
    from winding_study.identification.tensile import TensileTest

    rows = _rows(path)
    strain, strain_unit = _column(path, rows, _STRAIN)
    stress, stress_unit = _column(path, rows, _STRESS)
    numbered = list(enumerate(rows, start=1))
    return TensileTest(
        strain=strain_unit * np.array([_number(path, i, row, strain) for i, row in numbered]),
        stress=stress_unit * np.array([_number(path, i, row, stress) for i, row in numbered]),
    )


def recorded_config(path: Path) -> WindingConfig:
    """Return the model that the solver's node of a recorded run had.

    Raises:
        SourceError: The recording does not say.
    """
    from cable_fem_node.ros.parameters import FemParameters
    from winding_core.parameters import ParameterError, build, declarations
    from winding_recorder.bags.notes import PARAMETERS
    from winding_recorder.bags.reading import read_notes
    from winding_ros.topics import FEM

    text = read_notes(path).get(f"{PARAMETERS}{FEM}") if path.is_dir() else None
    if text is None:
        raise SourceError(f"{path} does not say what was wound: give --case or a condition")
    try:
        stated: Mapping[str, Any] = json.loads(text)
        known = {item.name for item in declarations(FemParameters)}
        own = {name: value for name, value in stated.items() if name in known}
        return build(FemParameters, own, owner=FEM).winding_config()
    except (json.JSONDecodeError, ParameterError, AttributeError) as error:
        raise SourceError(f"what {path} says of {FEM} cannot be used: {error}") from error


def read_recording(path: Path, config: WindingConfig) -> TrackedRun:
    """Read tracked markers, machine and load cell of a recorded run.

    Raises:
        SourceError: A topic is missing or empty, or no marker was measured.
        BagError: The recording cannot be read.
    """
    from cable_fem_node.identification import TrackedRun
    from cable_fem_node.identification.steady import SteadyMarkers
    from winding_core.markers import MARKER_DTYPE

    tracked = _messages(path, "tracker/markers")
    steady = SteadyMarkers()
    for rows in tracked:
        records = np.zeros(len(rows), dtype=MARKER_DTYPE)
        for i, row in enumerate(rows):
            for name in MARKER_DTYPE.names or ():
                if name not in row:
                    raise SourceError(f"tracker/markers of {path} has no field {name}")
                records[name][i] = row[name]
        steady.add(records)
    readings = steady.readings()
    if readings is None:
        raise SourceError(f"no marker of {path} was measured steadily")
    return TrackedRun(config=config, inputs=_recorded_inputs(path), readings=readings)


def _recorded_inputs(path: Path) -> Inputs:
    from cable_fem_node.winding.run_history import RunHistory
    from winding_core.readings import AxisReading

    joints = [row for rows in _messages(path, "rig/joint_states") for row in rows]
    pulls = [row for rows in _messages(path, "rig/tension") for row in rows]
    pull_times = np.array([row["t"] for row in pulls])
    history = RunHistory()
    begin = float(joints[0]["t"])
    last = -math.inf
    for row in joints:
        t = float(row["t"]) - begin
        if t <= last:
            continue
        last = t
        newest = int(np.searchsorted(pull_times, row["t"] + 1.0e-6, side="right")) - 1
        force = None if newest < 0 else max(float(pulls[newest]["wrench.force.x"]), 0.0)
        try:
            reading = AxisReading(
                cylinder_angle=row["cylinder_joint.position"],
                angular_speed=row["cylinder_joint.velocity"],
                carriage_position=row["carriage_joint.position"],
                feed_speed=row["carriage_joint.velocity"],
            )
        except KeyError as error:
            raise SourceError(f"rig/joint_states of {path} lacks {error}") from error
        history.record(t, reading, force)
    return history.inputs


def _messages(path: Path, name: str) -> list[list[dict[str, Any]]]:
    """Return every message of the topic with that last name, as rows; at least one message."""
    from winding_recorder.bags.reading import decoded, messages_of, opened
    from winding_recorder.bags.tables import rows_of

    with opened(path) as reader:
        links = [link for link in reader.connections if f"/{link.topic}".endswith(f"/{name}")]
        if len(links) != 1:
            raise SourceError(f"{path} must hold {name} once, it holds {len(links)} of it")
        rows = [
            rows_of(stamp, decoded(reader, link, data))
            for link, stamp, data in messages_of(reader, links)
        ]
    if not rows:
        raise SourceError(f"{name} of {path} is empty")
    return rows


def _rows(path: Path) -> list[dict[str, str]]:
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise SourceError(f"cannot read {path}: {error}") from error
    if not rows:
        raise SourceError(f"{path} holds no row of numbers below a head line")
    for line, row in enumerate(rows, start=1):
        # The reader puts cells without a heading under None.
        if None in row:
            raise SourceError(f"row {line} of {path} has more cells than the head line")
    return rows


def _column(
    path: Path, rows: Sequence[Mapping[str, str]], known: Mapping[str, float]
) -> tuple[str, float]:
    found = [name for name in known if name in rows[0]]
    if len(found) != 1:
        raise SourceError(
            f"{path} needs one column of {', '.join(known)}; it has {', '.join(rows[0])}"
        )
    return found[0], known[found[0]]


def _whole(path: Path, line: int, row: Mapping[str, str]) -> int:
    text = str(row["marker"]).strip()
    digits = text.removeprefix("P")
    if not digits.isdecimal():
        raise SourceError(f"row {line} of {path}: marker must be a whole number, got {text!r}")
    return int(digits)


def _number(
    path: Path, line: int, row: Mapping[str, str], name: str, default: float | None = None
) -> float:
    text = row.get(name)
    if text is None and default is not None:
        return default
    try:
        return float(text or "")
    except ValueError:
        raise SourceError(f"row {line} of {path}: {name} must be a number, got {text!r}") from None
