"""What `winding plan` has to say of a plan: for people, and as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.table import Table

from lay_control_node.planning.lay_plan import FULL_TURN
from lay_control_node.planning.plan_files import plan_turns
from winding_core.units import MILLIMETRE

if TYPE_CHECKING:
    from rich.console import Console

    from lay_control_node.control.expected_landing import ExpectedLanding
    from lay_control_node.planning.lay_plan import LayPlan
    from winding_study.plans.solver_check import SolverLay


# What a marker is asked to keep under control [rad]: the first one lands before any is measured.
_FIRST, _LATER = 0.02 * FULL_TURN, 0.01 * FULL_TURN


def print_plan(
    console: Console,
    plan: LayPlan,
    solver: SolverLay | None,
    controlled: tuple[ExpectedLanding, ...] = (),
) -> None:
    """Print the lay turn by turn, the markers, and what is out of reach."""
    console.print(_turns(plan, solver))
    if any(math.isfinite(item.wanted) for item in plan.landings):
        console.print(_markers(plan, solver, controlled))
    planned, uncompensated = (value / MILLIMETRE for value in plan.rms())
    worst, where = plan.worst
    lines = [
        f"off the program by {planned:.3g} mm rms after the first turn, uncompensated by "
        f"{uncompensated:.3g} mm; at most {worst / MILLIMETRE:.3g} mm, at turn "
        f"{where / FULL_TURN:.2f}"
    ]
    if solver is not None:
        worst, where = solver.worst
        lines.append(
            f"by the solver {solver.rms() / MILLIMETRE:.3g} mm rms, at most "
            f"{worst / MILLIMETRE:.3g} mm, at turn {where / FULL_TURN:.2f}"
        )
    lines.append(
        f"the machine moves for {plan.motion.end:.4g} s; lag {plan.lag:.3g} rad, corners are "
        f"rounded over {4.0 * plan.width:.3g} rad"
    )
    lines += [f"out of reach: {sentence}" for sentence in plan.sentences]
    lines += list(_uncertain(controlled))
    console.print("\n".join(lines), highlight=False, soft_wrap=True, markup=False)


def verdict(plan: LayPlan, solver: SolverLay | None, tolerance_mm: float | None) -> str:
    """Return why a tolerance [mm] is not kept; empty where it is, or where there is none."""
    if tolerance_mm is None:
        return ""
    found = {"the lag law": plan.worst}
    if solver is not None:
        found["the solver"] = solver.worst
    for name, (worst, where) in found.items():
        if worst > tolerance_mm * MILLIMETRE:
            return (
                f"by {name} the cable would lie {worst / MILLIMETRE:.3g} mm off at turn "
                f"{where / FULL_TURN:.2f}, the tolerance is {tolerance_mm:g} mm"
            )
    return ""


def control_record(controlled: tuple[ExpectedLanding, ...]) -> list[dict[str, Any]]:
    """Return where markers land under control as plain values."""
    return [
        {
            "id": item.number,
            "wanted_rad": item.wanted,
            "expected_rad": item.expected if math.isfinite(item.expected) else None,
            "sigma_rad": item.sigma if math.isfinite(item.sigma) else None,
            "misses_rad": item.misses if math.isfinite(item.misses) else None,
        }
        for item in controlled
    ]


def _uncertain(controlled: tuple[ExpectedLanding, ...]) -> Iterator[str]:
    """Yield which markers may miss their angles under control, and why."""
    missing = [item for item in controlled if not item.misses <= _bar(item.number)]
    for item in missing:
        if not math.isfinite(item.misses):
            yield f"under control P{item.number} may not land by the end"
            continue
        off, spread, at_most = (
            100.0 * value / FULL_TURN
            for value in (item.expected - item.wanted, 2.0 * item.sigma, item.misses)
        )
        yield (
            f"under control P{item.number} lands {off:+.2g} % of a turn from its place, give or "
            f"take {spread:.2g} % (two deviations), and by up to {at_most:.2g} % in an unusual rig"
        )
    if missing:
        yield (
            "under control the tension that reaches the cylinder is learnt from the markers that "
            "land, and the pull changes no faster than friction holds what lies"
        )


def _bar(number: int) -> float:
    return _FIRST if number == 1 else _LATER


def solver_record(solver: SolverLay | None) -> dict[str, Any] | None:
    """Return the solver's word as plain values; None where it was not asked."""
    if solver is None:
        return None
    worst, where = solver.worst
    return {
        "residual_rms_m": solver.rms(),
        "residual_worst_m": worst,
        "residual_worst_at_rad": where,
        "theta_rad": solver.theta.tolist(),
        "z_m": solver.z.tolist(),
        "markers_rad": [value if math.isfinite(value) else None for value in solver.markers],
    }


def _turns(plan: LayPlan, solver: SolverLay | None) -> Table:
    table = Table(title=plan.program.name)
    columns = ["turn", "wanted z, mm", "planned, mm", "off by, mm", "uncompensated off by, mm"]
    if solver is not None:
        columns.append("solver off by, mm")
    for column in columns:
        table.add_column(column, justify="right")
    for theta, wanted, predicted, without in plan_turns(plan):
        cells = [
            f"{theta / FULL_TURN:.2f}",
            f"{wanted / MILLIMETRE:.2f}",
            f"{predicted / MILLIMETRE:.2f}",
            f"{(predicted - wanted) / MILLIMETRE:.3f}",
            f"{(without - wanted) / MILLIMETRE:.2f}",
        ]
        if solver is not None:
            off = float(solver.z_at(np.array([theta]))[0]) - wanted
            cells.append(f"{off / MILLIMETRE:.3f}" if math.isfinite(off) else "-")
        table.add_row(*cells)
    return table


def _markers(
    plan: LayPlan, solver: SolverLay | None, controlled: tuple[ExpectedLanding, ...]
) -> Table:
    table = Table(title="Markers, in turns")
    columns = ["marker", "wanted", "planned", "pull, N", "in reach"]
    if solver is not None:
        columns.append("solver")
    under_control = {item.number: item for item in controlled}
    if under_control:
        columns.append("under control, +- 2 sigma")
    for column in columns:
        table.add_column(column, justify="right")
    for item in plan.landings:
        reach = f"{_in_turns(item.earliest)} to {_in_turns(item.latest)}"
        cells = [
            f"P{item.number}",
            _in_turns(item.wanted),
            _in_turns(item.predicted),
            f"{item.pull:.3f}",
            reach if math.isfinite(item.earliest) else "-",
        ]
        if solver is not None:
            cells.append(_in_turns(float(solver.markers[item.number - 1])))
        if item.number in under_control:
            found = under_control[item.number]
            cells.append(f"{_in_turns(found.expected)} +- {2.0 * found.sigma / FULL_TURN:.4f}")
        table.add_row(*cells)
    return table


def _in_turns(angle: float) -> str:
    return f"{angle / FULL_TURN:.4f}" if math.isfinite(angle) else "-"
