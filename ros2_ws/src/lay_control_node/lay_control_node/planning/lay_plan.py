"""A planned run: motion and pull over time, what will lie where, and its table for a PLC."""

import csv
import io
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lay_control_node.planning.marker_pulls import MarkerLanding, PullPlan, Track
from lay_control_node.planning.motion import Motion
from winding_core.cable.condition import ResolvedCondition
from winding_core.lay.limits import PlanLimits
from winding_core.lay.program import LayProgram
from winding_core.lay.rounding import Corner
from winding_core.units import json_values

Array = NDArray[np.float64]

FULL_TURN = 2.0 * math.pi
_PER_TURN = 200  # Points per turn at which residuals are compared


@dataclass(frozen=True, kw_only=True)
class PlannedSamples:
    """Both axes and the pull at times."""

    t: Array  # [s], shape (m,)
    cylinder: Array  # Angle [rad], shape (m,)
    cylinder_speed: Array  # [rad/s], shape (m,)
    guide: Array  # Position [m], shape (m,)
    guide_speed: Array  # [m/s], shape (m,)
    commanded: Array  # Pull that is asked for [N], shape (m,)
    pull: Array  # Pull that the brake gives [N], shape (m,)
    span: Array  # Tension of the span under it [N], shape (m,)


@dataclass(frozen=True, kw_only=True)
class LayPlan:
    """What the machine shall do for a program, and what comes of it."""

    program: LayProgram  # What is wanted
    what: ResolvedCondition  # What is wound
    limits: PlanLimits  # Of the machine
    lag: float  # Of the lay behind the guide [rad], free length over centreline radius
    radius: float  # Of the wound cable's centreline [m]; both on the bare cylinder
    width: float  # Of the kernel that rounds the corners [rad]
    speed: float  # Of the cylinder where nothing slows it [rad/s]
    motion: Motion  # Of both axes
    theta: Array  # Wound angles of the prediction, not descending [rad], shape (n,)
    predicted: Array  # z of the lay there by the lag law [m], shape (n,)
    # z of the lay there with a guide that moves along the program itself [m], shape (n,).
    uncompensated: Array
    corners: tuple[Corner, ...]  # That are rounded
    track: Track  # On which the pull is planned
    pulls: PullPlan  # The pull, and where markers land
    sentences: tuple[str, ...]  # What is out of reach, and why

    @property
    def residual(self) -> Array:
        """Predicted less wanted z [m], shape (n,)."""
        return np.asarray(self.predicted - self.program.z_at(self.theta))

    @property
    def worst(self) -> tuple[float, float]:
        """Largest distance of the predicted lay from the wanted one [m], and where [rad]."""
        off = np.abs(self.residual)
        at = int(np.argmax(off))
        return float(off[at]), float(self.theta[at])

    def rms(self) -> tuple[float, float]:
        """Return the residual's root mean square after the first turn [m]: planned, uncompensated.

        Over the wound angle; of a program of less than two turns over all of it.
        """
        start = FULL_TURN if self.program.end >= 2.0 * FULL_TURN else 0.0
        count = max(2, math.ceil((self.program.end - start) / FULL_TURN * _PER_TURN))
        theta = np.linspace(start, self.program.end, count)
        planned, without = (
            np.interp(theta, self.theta, lay) - self.program.z_at(theta)
            for lay in (self.predicted, self.uncompensated)
        )
        return float(np.sqrt(np.mean(planned**2))), float(np.sqrt(np.mean(without**2)))

    def samples(self, t: Array) -> PlannedSamples:
        """Return both axes and the pull at times [s], shape (m,)."""
        cylinder, cylinder_speed, guide, guide_speed = self.motion.at(t)
        at = np.clip(np.searchsorted(self.track.t, t, side="right") - 1, 0, self.track.t.size - 1)
        pull = np.interp(t, self.track.t, self.pulls.actual)
        case = self.what.case
        wound = case.centreline_radius * cylinder
        return PlannedSamples(
            t=t,
            cylinder=cylinder,
            cylinder_speed=cylinder_speed,
            guide=guide,
            guide_speed=guide_speed,
            commanded=self.pulls.commanded[at],
            pull=pull,
            span=self.what.tension_law.along(pull, case.cylinder_diameter, wound),
        )

    def times(self, period: float) -> Array:
        """Return times every period [s] from 0 until the machine stands, shape (m,)."""
        return np.asarray(period * np.arange(math.ceil(self.motion.end / period - 1.0e-9) + 1))

    @property
    def landings(self) -> tuple[MarkerLanding, ...]:
        """Where the markers will land."""
        return self.pulls.landings


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
            json_values(item, "theta_rad", "rounding_m", "rounding_at_half_speed_m")
            for item in plan.corners
        ],
        "markers": [
            {"id": item.number}
            | json_values(item, "wanted_rad", "predicted_rad", "pull_n")
            | json_values(item, "earliest_rad", "latest_rad")
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
