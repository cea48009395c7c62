"""What `winding predict --check` prints: every number that decides whether it can be right."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rich.table import Table

from winding_core.units import MILLIMETRE

if TYPE_CHECKING:
    from cable_fem_node.winding.expected_cost import ExpectedCost
    from cable_fem_node.winding.prediction import PlannedRun
    from cable_fem_node.winding.validity import Check


def checks_table(checks: tuple[Check, ...]) -> Table:
    """Return the checks of a run with their limits."""
    table = Table("check", title="Whether the solver can be right about it")
    for column in ("value", "doubtful above", "refused from", "verdict"):
        table.add_column(column, justify="right")
    for check in checks:
        table.add_row(
            check.name.rstrip(","),
            f"{check.value:.3g}",
            _limit(check.warned_from),
            _limit(check.refused_from),
            "doubtful" if check.warned else "ok",
        )
    return table


def cost_sentences(run: PlannedRun, cost: ExpectedCost) -> str:
    """Return the element and the step that a run is wound with, and what it takes."""
    resolved = run.config.resolved
    return (
        f"elements of {resolved.segment / MILLIMETRE:.4g} mm, steps of {resolved.step:.3g} s, "
        f"stretch {resolved.stretch:.5g} in the span, tension {resolved.tension:.4g} N there and "
        f"{resolved.wound_tension(resolved.tension):.4g} N on the cylinder\n"
        f"winding {run.duration:g} s takes about {cost.cpu_seconds:.2g} s of processor time "
        f"({cost.steps} steps of {cost.elements:.0f} elements); up to a mass scaling of "
        f"{cost.mass_scaling:g} the cable lies the same, which takes about "
        f"{cost.scaled_cpu_seconds:.2g} s"
    )


def _limit(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else "-"
