"""A plan as a picture: the lay, what remains, and both axes and the pull over time."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from lay_control_node.planning.lay_plan import FULL_TURN, LayPlan
from winding_core.units import MILLIMETRE
from winding_reports.documents.picture import (
    CORRECTED,
    DOTS_PER_INCH,
    FAINT,
    PAPER,
    PREDICTED,
    canvas,
    thinned,
)
from winding_study.plans.solver_check import SolverLay

PICTURE_KINDS = (".png", ".svg", ".pdf")
_PERIOD = 0.01


def write_plan_picture(plan: LayPlan, solver: SolverLay | None, path: Path, kind: str) -> None:
    """Draw a plan.

    Args:
        plan: The plan.
        solver: The plan as the solver winds it; None without.
        path: Of the picture.
        kind: One of PICTURE_KINDS.

    Raises:
        OSError: It cannot be written.
    """
    with canvas(8.4, rows=3, columns=2) as (figure, axes):
        lay, residual, guide, feed, cylinder, pull = axes
        _draw_lay(lay, residual, plan, solver)
        _draw_motion(guide, feed, cylinder, pull, plan)
        figure.suptitle(plan.program.name, x=0.01, ha="left", fontweight="bold")
        figure.savefig(path, format=kind.removeprefix("."), dpi=DOTS_PER_INCH)


def _draw_lay(lay: Axes, residual: Axes, plan: LayPlan, solver: SolverLay | None) -> None:
    turns = plan.theta / FULL_TURN
    wanted = plan.program.z_at(plan.theta)
    lay.plot(*thinned(turns, wanted / MILLIMETRE), color=FAINT, linewidth=4.0, label="wanted")
    lay.plot(
        *thinned(turns, plan.uncompensated / MILLIMETRE),
        color=PAPER,
        linestyle="--",
        label="guide along the program itself",
    )
    lay.plot(*thinned(turns, plan.predicted / MILLIMETRE), color=PREDICTED, label="planned")
    lay.set_title("lay: z over turns, mm")
    lay.legend(loc="upper left")
    residual.axhline(0.0, color=FAINT, linewidth=0.8)
    residual.plot(
        *thinned(turns, plan.residual / MILLIMETRE), color=PREDICTED, label="planned, lag law"
    )
    if solver is not None:
        residual.plot(
            *thinned(solver.theta / FULL_TURN, solver.residual / MILLIMETRE),
            color=CORRECTED,
            linewidth=1.0,
            label="planned, solver",
        )
    for corner in plan.corners:
        residual.axvline(corner.theta / FULL_TURN, color=FAINT, linewidth=0.6, linestyle=":")
    without = plan.rms()[1] / MILLIMETRE
    residual.set_title(f"off the program, mm (uncompensated {without:.2g} mm rms)")
    residual.legend(loc="best")
    for axes in (lay, residual):
        axes.set_xlabel("turns")
        axes.set_xlim(0.0, plan.program.end / FULL_TURN)


def _draw_motion(guide: Axes, feed: Axes, cylinder: Axes, pull: Axes, plan: LayPlan) -> None:
    rows = plan.samples(plan.times(_PERIOD))
    limits = plan.limits
    laid = plan.program.z_at(rows.cylinder)
    guide.plot(*thinned(rows.t, laid / MILLIMETRE), color=FAINT, linewidth=3.0, label="program")
    guide.plot(*thinned(rows.t, rows.guide / MILLIMETRE), color=PREDICTED, label="guide")
    guide.set_title("guide and where the cable is wanted, mm")
    guide.legend(loc="best")
    feed.plot(*thinned(rows.t, rows.guide_speed / MILLIMETRE), color=PREDICTED)
    for sign in (-1.0, 1.0):
        feed.axhline(
            sign * limits.carriage_speed / MILLIMETRE, color=PAPER, linewidth=0.8, linestyle=":"
        )
    feed.set_title("guide speed and its limits, mm/s")
    cylinder.plot(*thinned(rows.t, rows.cylinder_speed), color=PREDICTED)
    cylinder.set_title("cylinder speed, rad/s")
    cylinder.set_ylim(bottom=0.0)
    pull.plot(*thinned(rows.t, rows.commanded), color=FAINT, linewidth=3.0, label="commanded")
    pull.plot(*thinned(rows.t, rows.pull), color=PREDICTED, label="of the brake")
    weight = plan.what.case.weight
    pull.axhline(weight, color=PAPER, linewidth=0.8, linestyle=":", label="weight")
    low, high = np.min(rows.commanded), np.max(rows.commanded)
    pull.set_ylim(0.9 * min(low, weight), 1.1 * max(high, weight))
    pull.set_title("pull, N")
    pull.legend(loc="best")
    for axes in (guide, feed, cylinder, pull):
        axes.set_xlabel("time, s")
        axes.set_xlim(0.0, float(rows.t[-1]))
