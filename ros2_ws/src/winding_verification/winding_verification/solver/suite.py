"""The verification suite: what problems are given, what they compute, and its references."""

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from importlib import import_module
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from cable_fem_node.dynamics.state import FloatArray

Values = dict[str, float | list[float]]


@cache
def references() -> dict[str, dict[str, Any]]:
    """Return the references by problem: title, source, what computes it, quantities, its data."""
    text = files("winding_verification").joinpath("data", "verification.json").read_text("utf-8")
    data: dict[str, dict[str, Any]] = json.loads(text)
    return data


def given(problem: str, name: str) -> FloatArray:
    """Return an array that a problem is given."""
    return np.asarray(references()[problem]["given"][name], dtype=float)


def rotation_about(axis: Sequence[float], angle: float) -> FloatArray:
    """Return the matrix (3, 3) that turns by an angle [rad] about an axis of any length."""
    turn = Rotation.from_rotvec(angle * np.asarray(axis) / np.linalg.norm(axis))
    return np.asarray(turn.as_matrix())


def rotations() -> Iterator[FloatArray]:
    """Yield rotation matrices (3, 3) about a skew axis, from a degree to two turns."""
    for degrees in (1.0, 10.0, 90.0, 180.0, 360.0, 720.0):
        yield rotation_about([1.0, 2.0, 3.0], math.radians(degrees))


def wave_record(times: NDArray[np.floating[Any]], way: Sequence[float]) -> Values:
    """Return the greatest way [m] of a tip, when it is there [s], and the way at whole times."""
    top = int(np.argmax(way))
    per_ms = round(1.0e-3 / float(times[0]))
    values: Values = {"peak": way[top], "t_peak": times[top]}
    for ms in (2, 3, 4, 6, 8, 10, 12):
        values[f"u_{ms}ms"] = way[per_ms * ms - 1]
    return values


# Where each problem is computed, as the table has it: module of this folder and function.
PROBLEMS: dict[str, str] = {name: data["computed_by"] for name, data in references().items()}


@dataclass(frozen=True, kw_only=True)
class Row:
    """One compared quantity."""

    problem: str  # Name of the problem
    title: str  # What it is about
    quantity: str  # Name of the quantity
    unit: str  # SI unit of reference and computed value
    reference: Any  # Number or nested list
    computed: Any  # Of the same shape
    error: float  # Greatest error
    tolerance: float  # Greatest error allowed
    relative: bool  # Whether errors count relative to the greatest reference value

    @property
    def passed(self) -> bool:
        """Whether the error is within the tolerance."""
        return self.error <= self.tolerance

    def record(self) -> dict[str, Any]:
        """Return the row for JSON."""
        record = asdict(self)
        kind = "relative" if record.pop("relative") else "absolute"
        return record | {"tolerance_kind": kind, "pass": self.passed}


def run_problem(name: str) -> list[Row]:
    """Compute one problem and compare all its quantities.

    Raises:
        ValueError: There is no such problem, or a computed quantity has no reference.
    """
    if name not in PROBLEMS:
        raise ValueError(f"problem must be one of {', '.join(PROBLEMS)}, got {name!r}")
    problem = references()[name]
    module, function = PROBLEMS[name].split(".")
    compute = getattr(import_module(f"winding_verification.solver.{module}"), function)
    computed: Values = compute()
    unknown = set(computed) ^ set(problem["quantities"])
    if unknown:
        raise ValueError(f"{name}: quantities without a counterpart: {', '.join(sorted(unknown))}")
    rows = []
    for quantity, expected in problem["quantities"].items():
        ((kind, tolerance),) = expected["tolerance"].items()
        reference = np.asarray(expected["reference"], dtype=float)
        value = np.asarray(computed[quantity], dtype=float)
        error = float(np.abs(value - reference).max())
        if kind == "rel":
            error /= float(np.abs(reference).max())
        rows.append(
            Row(
                problem=name,
                title=problem["title"],
                quantity=quantity,
                unit=expected["unit"],
                reference=expected["reference"],
                computed=value.tolist(),
                tolerance=tolerance,
                relative=kind == "rel",
                error=error,
            )
        )
    return rows
