"""Scenarios of cosseratbench: what its folders describe, and a row of what is compared."""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cable_fem_node.dynamics.state import FloatArray
from winding_core.units import known
from winding_verification.rod.rod import RodSection

FREE, PINNED, CLAMPED = ENDS = ("free", "pinned", "clamped")
# A Poisson's ratio of one half would make the bulk modulus infinite; GJ is within 1e-4 of it.
_MOST_POISSON = 0.4999


class ExternalFileError(ValueError):
    """A file lacks or contradicts what its format requires."""


@dataclass(frozen=True, kw_only=True)
class ScenarioRod:
    """One rod, straight when unstressed."""

    line: FloatArray  # Points of its centreline at the start (n, 3) [m]
    arc: FloatArray  # Unstressed distance along the rod to each of them (n,) [m], from 0
    section: RodSection  # Section and material
    start: str  # How the first end is held, one of ENDS
    end: str  # How the last end is held
    load: FloatArray  # Dead force on the last end (3,) [N]
    turn_times: FloatArray  # When the last end's clamp has turned (m,) [s]; empty if it stands
    turn: FloatArray  # By how much about the rod's own direction there (m,) [rad]
    slides: bool  # Whether the last end's clamp may slide along the rod

    @property
    def length(self) -> float:
        """Unstressed length [m]."""
        return float(self.arc[-1])

    def nodes(self, elements: int) -> tuple[FloatArray, FloatArray]:
        """Return nodes (elements + 1, 3) [m] and unstressed lengths between them (elements,)."""
        at = np.linspace(0.0, self.length, elements + 1)
        columns = [np.interp(at, self.arc, column) for column in self.line.T]
        return np.stack(columns, axis=1), np.diff(at)


@dataclass(frozen=True, kw_only=True)
class Obstacle:
    """A fixed cylinder through the origin."""

    axis: FloatArray  # Unit vector (3,)
    radius: float  # [m]
    friction: float  # Coulomb's coefficient


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """One variant of an experiment."""

    experiment: str  # Its name
    values: Mapping[str, float]  # Its parameters
    rods: tuple[ScenarioRod, ...]  # At least one
    obstacles: tuple[Obstacle, ...]  # Fixed cylinders
    gravity: FloatArray  # (3,) [m/s^2]
    duration: float  # [s]
    quasi_static: bool  # Whether damping may be added
    # Metrics of other solvers beside it, by solver.
    published: Mapping[str, Mapping[str, float | None]]

    @property
    def variant(self) -> str:
        """Its parameters as text."""
        return ", ".join(f"{name} {value:g}" for name, value in sorted(self.values.items()))


def read_scenario(file: Path) -> Scenario:
    """Return the scenario of an experiment.json, with the results that lie beside it.

    Raises:
        ExternalFileError: It is not one; names the file and the cause.
    """
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
        entry = content["scenario"]
        scenario = Scenario(
            experiment=str(content["name"]),
            values={str(name): float(value) for name, value in content["values"].items()},
            rods=tuple(_rod(rod) for rod in entry["rods"]),
            obstacles=tuple(_obstacle(item) for item in entry.get("obstacles") or ()),
            gravity=_vector(entry["gravity"]),
            duration=_positive("duration", entry["duration"]),
            quasi_static=bool(entry["quasi_static"]),
            published=_published(file.parent),
        )
    except KeyError as error:
        raise ExternalFileError(f"{file} is no experiment of cosseratbench: no {error}") from error
    except (OSError, ValueError, TypeError, AttributeError) as error:
        raise ExternalFileError(f"{file} is no experiment of cosseratbench: {error}") from error
    if not scenario.rods:
        raise ExternalFileError(f"{file} is no experiment of cosseratbench: it has no rods")
    return scenario


def _rod(entry: Mapping[str, Any]) -> ScenarioRod:
    line = np.array(entry["centerline"], dtype=float)
    if line.ndim != 2 or line.shape[0] < 2 or line.shape[1] != 3 or not np.isfinite(line).all():
        raise ValueError(f"a centerline must be finite with shape (n, 3), got {line.shape}")
    gaps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    given = entry.get("rest_arc_length")
    arc = np.concatenate([[0.0], np.cumsum(gaps)]) if given is None else np.array(given, float)
    if arc.shape != line.shape[:1] or arc[0] != 0.0 or not (np.diff(arc) > 0.0).all():
        raise ValueError("rest_arc_length must begin with 0 and ascend, one for each point")
    material = entry["material"]
    young = _positive("youngs_modulus", material["youngs_modulus"])
    shear = _positive("shear_modulus", material["shear_modulus"])
    section = RodSection(
        diameter=2.0 * _positive("radius", entry["radius"]),
        young=young,
        poisson=min(0.5 * young / shear - 1.0, _MOST_POISSON),
        density=_positive("density", material["density"]),
    )
    start, end = entry["start"], entry["end"]
    for held in (start, end):
        if held not in ENDS:
            raise ValueError(f"an end must be one of {', '.join(ENDS)}, got {held!r}")
    load = np.zeros(3)
    for item in entry["loads"]:
        if item["at"] != "end":
            raise ValueError(f"loads must act at the end, got {item['at']!r}")
        load += _vector(item["force"])
    if entry.get("start_motion") is not None:
        raise ValueError("start_motion must be null")
    times, turn, slides = _motion(entry.get("end_motion"), line[-1] - line[-2])
    return ScenarioRod(
        line=line,
        arc=arc,
        section=section,
        start=start,
        end=end,
        load=load,
        turn_times=times,
        turn=turn,
        slides=slides,
    )


def _motion(
    entry: Mapping[str, Any] | None, direction: FloatArray
) -> tuple[FloatArray, FloatArray, bool]:
    if entry is None:
        return np.zeros(0), np.zeros(0), False
    times = np.array(entry["times"], dtype=float)
    rotation = np.array(entry["rotation"], dtype=float)
    if np.any(np.array(entry["displacement"], dtype=float)):
        raise ValueError("an end may turn and not be displaced")
    if rotation.shape != (times.size, 3) or not (np.diff(times) > 0.0).all():
        raise ValueError("rotation must have three numbers for each of times, which ascend")
    axis = direction / np.linalg.norm(direction)
    turn = rotation @ axis
    # A rod that starts a little bent turns about its clamps' line, not its last piece.
    if not np.allclose(np.abs(turn), np.linalg.norm(rotation, axis=1), rtol=1.0e-3):
        raise ValueError("an end may turn about the rod's own direction alone")
    slides = entry.get("slides_along")
    return times, turn, slides is not None


def _obstacle(entry: Mapping[str, Any]) -> Obstacle:
    axis = _vector(entry["axis"])
    if np.any(_vector(entry["center"])):
        raise ValueError("a cylinder must lie in the origin")
    return Obstacle(
        axis=axis / np.linalg.norm(axis),
        radius=_positive("radius of a cylinder", entry["radius"]),
        friction=float(entry["friction"]),
    )


def _published(folder: Path) -> dict[str, dict[str, float | None]]:
    found = {}
    for file in sorted(folder.glob("*/result.json")):
        result = json.loads(file.read_text(encoding="utf-8"))
        metrics = result.get("metrics") or {}
        found[str(result["solver"])] = {name: known(value) for name, value in metrics.items()}
    return found


def _vector(entry: Any) -> FloatArray:
    vector = np.array(entry, dtype=float)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise ValueError(f"a vector must be three finite numbers, got {entry}")
    return vector


def _positive(name: str, entry: Any) -> float:
    value = float(entry)
    if not (math.isfinite(value) and value > 0.0):
        raise ValueError(f"{name} must be positive and finite, got {entry}")
    return value


@dataclass(frozen=True, kw_only=True)
class ExternalRow:
    """One quantity of one experiment."""

    experiment: str  # Its name
    variant: str  # Its parameters
    quantity: str  # As the experiment's own definition has it, SI
    computed: float  # With this project's rod
    bar: float | None = None  # What its magnitude is held against; None for what is only reported
    at_least: bool = False  # Whether it must reach the bar, instead of staying below it
    # Of others, by solver; None for what they could not compute.
    published: Mapping[str, float | None] = field(default_factory=dict)

    @property
    def passed(self) -> bool:
        """Whether the bar is kept; a nan never keeps one."""
        if self.bar is None:
            return True
        size = abs(self.computed)
        return size >= self.bar if self.at_least else size <= self.bar

    def record(self) -> dict[str, Any]:
        """Return the row for JSON."""
        record = asdict(self)
        kind = "least" if record.pop("at_least") else "most"
        return record | {"bar_is": kind, "pass": self.passed}
