"""Sources of an identification: tables of markers, a tensile test, rows of a recorded run."""

import csv
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cable_fem_node.identification import DEFAULT_SIGMA_THETA, DEFAULT_SIGMA_Z, Readings, TrackedRun
from cable_fem_node.identification.steady import SteadyMarkers
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.machine.axes import AxisReader, JointSample, MachineAxes
from winding_core.machine.readings import GuidePlace
from winding_core.markers import MARKER_DTYPE
from winding_core.run_inputs import Inputs, RunHistory
from winding_core.units import KILOPASCAL, MEGAPASCAL
from winding_study.identification.tensile import TensileTest

MARKER_COLUMNS = ("marker", "theta_rad", "z_m")
_STRAIN = {"strain": 1.0, "strain_pct": 0.01}
_STRESS = {"stress_mpa": MEGAPASCAL, "stress_pa": 1.0, "stress_kpa": KILOPASCAL}
Messages = Sequence[Sequence[dict[str, Any]]]  # Messages of one topic, each as rows by column name


class SourceError(ValueError):
    """A source of an identification cannot be used."""


def read_readings(path: Path) -> Readings:
    """Read a CSV with the columns marker, theta_rad, z_m and, if known, their deviations.

    Raises:
        SourceError: It cannot be read, or a column is missing or holds no number.
        IdentificationError: The markers contradict each other.
    """
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
    rows = _rows(path)
    strain, strain_unit = _column(path, rows, _STRAIN)
    stress, stress_unit = _column(path, rows, _STRESS)
    numbered = list(enumerate(rows, start=1))
    return TensileTest(
        strain=strain_unit * np.array([_number(path, i, row, strain) for i, row in numbered]),
        stress=stress_unit * np.array([_number(path, i, row, stress) for i, row in numbered]),
    )


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


def recorded_run(
    config: WindingConfig, *, tracked: Messages, joints: Messages, tension: Messages
) -> TrackedRun:
    """Return markers, machine and load cell of a recording.

    Args:
        config: What was wound.
        tracked: tracker/markers.
        joints: rig/joint_states; at least one message.
        tension: rig/tension.

    Raises:
        SourceError: A column is missing, or no marker was measured.
    """
    steady = SteadyMarkers()
    try:
        for rows in tracked:
            records = np.zeros(len(rows), dtype=MARKER_DTYPE)
            for name in MARKER_DTYPE.names or ():
                records[name] = [row[name] for row in rows]
            steady.add(records)
        inputs = _inputs(_flat(joints), _flat(tension))
    except KeyError as error:
        raise SourceError(f"the recording lacks {error}") from error
    readings = steady.readings()
    if readings is None:
        raise SourceError("no marker of the recording was measured steadily")
    return TrackedRun(config=config, inputs=inputs, readings=readings)


def _flat(messages: Messages) -> list[dict[str, Any]]:
    return [row for rows in messages for row in rows]


def _inputs(joints: Sequence[dict[str, Any]], pulls: Sequence[dict[str, Any]]) -> Inputs:
    pull_times = np.array([row["t"] for row in pulls])
    history, read = RunHistory(), AxisReader(MachineAxes()).read
    begin = float(joints[0]["t"])
    last = -math.inf
    for row in joints:
        t = float(row["t"]) - begin
        if t <= last:
            continue
        last = t
        newest = int(np.searchsorted(pull_times, row["t"] + 1.0e-6, side="right")) - 1
        force = None if newest < 0 else max(float(pulls[newest]["wrench.force.x"]), 0.0)
        x, y = (row.get(f"guide_{axis}_joint.position") for axis in "xy")
        sample = JointSample(
            t=t,
            cylinder=row["cylinder_joint.position"],
            carriage=row["carriage_joint.position"],
            cylinder_speed=row.get("cylinder_joint.velocity", math.nan),
            carriage_speed=row.get("carriage_joint.velocity", math.nan),
            guide=None if x is None or y is None else GuidePlace(x=float(x), y=float(y)),
        )
        reading = read(sample)
        history.record(t, reading, force)
    return history.inputs
