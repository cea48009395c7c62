"""The verification suite: every problem's computed quantities against its references."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from winding_verification.solver import (
    laws,
    rod_contact,
    rod_dynamics,
    rod_statics,
    solids,
    winding_rod,
    winding_runs,
    winding_solid,
)
from winding_verification.solver.references import Values, references

PROBLEMS: dict[str, Callable[[], Values]] = {
    "B01": rod_statics.axial_frequencies,
    "B04": rod_statics.bending_frequencies,
    "B05": rod_statics.stretched_string,
    "B07": rod_statics.elastica,
    "B08": rod_statics.roll_up,
    "B10": rod_statics.quarter_arc,
    "B11": rod_statics.heavy_cantilever,
    "B13": rod_statics.buckling,
    "B16": rod_statics.catenary,
    "B17": rod_dynamics.weight_on_cable,
    "B19": rod_dynamics.free_flight,
    "B20": rod_dynamics.pendulum,
    "B22": rod_statics.density_invariance,
    "C01": rod_contact.capstan,
    "C03": rod_contact.atwood,
    "C05": rod_contact.stored_tension,
    "C06": rod_contact.normal_force,
    "C09": rod_contact.sliding,
    "C11": winding_runs.lateral_slip,
    "D01": solids.uniform_bar,
    "D02": solids.clamped_bar,
    "D03": solids.cantilever,
    "D05": solids.pure_bending,
    "D06": solids.modes,
    "D08": rod_contact.drape,
    "D10": solids.step_load,
    "D10r": rod_dynamics.step_load,
    "H01": solids.rigid_rotation,
    "H01r": rod_statics.rigid_rotation,
    "H02": solids.patch,
    "H03": solids.geometry,
    "H05": solids.critical_steps,
    "H08": solids.section_properties,
    "M01": laws.uniaxial,
    "M02": laws.incompressible,
    "M03": laws.limit_load,
    "M04": laws.follower_pressure,
    "M05": laws.general,
    "M07": laws.simple_shear,
    "M09": laws.hydrostatic,
    "M10": laws.biot,
    "V01": winding_rod.longitudinal,
    "V02": winding_rod.transverse,
    "V03": winding_rod.bending,
    "V04": winding_rod.capstan,
    "V05": winding_rod.contact,
    "V06": winding_rod.lift_off,
    "V07": winding_rod.ring,
    "V08": winding_rod.lag,
    "V11": winding_solid.longitudinal,
    "V12": winding_solid.capstan,
    "V13": winding_solid.lag,
    "W01": winding_runs.helix,
    "W02": winding_runs.drive,
    "W03": winding_runs.fleet_angle,
    "W04": winding_runs.quasi_static,
    "W05": winding_runs.radius_convention,
    "W06": winding_runs.case_4,
}


@dataclass(frozen=True, kw_only=True)
class Row:
    """One compared quantity.

    Attributes:
        problem: Name of the problem.
        title: What it is about.
        quantity: Name of the quantity.
        unit: SI unit of reference and computed value.
        reference: Number or nested list.
        computed: Of the same shape.
        tolerance: Greatest error allowed.
        relative: Whether errors count relative to the greatest reference value.
        error: Greatest error.
    """

    problem: str
    title: str
    quantity: str
    unit: str
    reference: Any
    computed: Any
    tolerance: float
    relative: bool
    error: float

    @property
    def passed(self) -> bool:
        """Whether the error is within the tolerance."""
        return self.error <= self.tolerance


def run_problem(name: str) -> list[Row]:
    """Compute one problem and compare all its quantities.

    Raises:
        ValueError: There is no such problem, or a computed quantity has no reference.
    """
    if name not in PROBLEMS:
        raise ValueError(f"problem must be one of {', '.join(PROBLEMS)}, got {name!r}")
    problem = references()[name]
    computed = PROBLEMS[name]()
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


def run_suite(names: list[str] | None = None) -> Iterator[tuple[str, list[Row]]]:
    """Yield (problem, rows) one problem after the other; all of them by default."""
    for name in PROBLEMS if names is None else names:
        yield name, run_problem(name)
