"""The verification suite: every problem's computed quantities against its references."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from importlib import import_module
from typing import Any

import numpy as np

from winding_verification.solver.references import Values, references

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
