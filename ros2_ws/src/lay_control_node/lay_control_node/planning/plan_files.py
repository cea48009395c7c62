"""A plan as a table for a PLC and as a record."""

from __future__ import annotations

import csv
import io
import math
from typing import Any

import numpy as np

from lay_control_node.planning.lay_plan import FULL_TURN, LayPlan

# Of the table; units in the names.
CSV_COLUMNS = ("t_s", "cylinder_rad", "guide_m", "tension_n")
PERIOD = 0.01


def csv_text(plan: LayPlan, period: float = PERIOD) -> str:
    """Return the motion every period [s] as a table: CSV_COLUMNS.

    Straight lines between its rows keep the limits. Digits are so many that third differences do.
    """
    rows = plan.samples(plan.times(period))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(CSV_COLUMNS)
    for t, cylinder, guide, pull in zip(
        rows.t.tolist(),
        rows.cylinder.tolist(),
        rows.guide.tolist(),
        rows.commanded.tolist(),
        strict=True,
    ):
        writer.writerow((f"{t:.6g}", f"{cylinder:.10f}", f"{guide:.12f}", f"{pull:.5f}"))
    return text.getvalue()


def plan_record(plan: LayPlan) -> dict[str, Any]:
    """Return a plan as plain values, None for what is not known."""
    planned, uncompensated = plan.rms()
    worst, where = plan.worst
    turns = plan_turns(plan)
    return {
        "program": {
            "name": plan.program.name,
            "theta_rad": plan.program.theta.tolist(),
            "z_m": plan.program.z.tolist(),
        },
        "case": plan.what.case.number,
        "lag_rad": plan.lag,
        "kernel_width_rad": plan.width,
        "start": {"approach_s": plan.motion.approach, "cylinder_waits_s": plan.motion.course.wait},
        "duration_s": plan.motion.end,
        "cylinder_speed_rad_s": plan.speed,
        "residual_rms_m": planned,
        "uncompensated_rms_m": uncompensated,
        "residual_worst_m": worst,
        "residual_worst_at_rad": where,
        "turns": [
            {"theta_rad": theta, "wanted_m": wanted, "predicted_m": predicted, "without_m": without}
            for theta, wanted, predicted, without in turns
        ],
        "corners": [
            {
                "theta_rad": item.theta,
                "rounding_m": item.rounding,
                "rounding_at_half_speed_m": item.rounding_at_half_speed,
            }
            for item in plan.corners
        ],
        "markers": [
            {
                "id": item.number,
                "wanted_rad": _known(item.wanted),
                "predicted_rad": _known(item.predicted),
                "pull_n": item.pull,
                "earliest_rad": _known(item.earliest),
                "latest_rad": _known(item.latest),
            }
            for item in plan.landings
        ],
        "out_of_reach": list(plan.sentences),
    }


def plan_turns(plan: LayPlan) -> list[tuple[float, float, float, float]]:
    """Return angle [rad], wanted, predicted and uncompensated z [m] after each turn and at the end.

    An end within a hundredth of a turn of a whole turn is that turn's.
    """
    end = plan.program.end
    whole = FULL_TURN * np.arange(1, int(end / FULL_TURN) + 1)
    theta = np.append(whole[whole < end - 0.01 * FULL_TURN], end)
    columns = (
        theta,
        plan.program.z_at(theta),
        np.interp(theta, plan.theta, plan.predicted),
        np.interp(theta, plan.theta, plan.uncompensated),
    )
    return list(zip(*(column.tolist() for column in columns), strict=True))


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
