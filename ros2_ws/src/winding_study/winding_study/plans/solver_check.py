"""A plan wound by the rod: where the cable lies by the solver, beside the lag law."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.run_ahead import replay
from cable_fem_node.winding.winding_config import WindingConfig
from lay_control_node.planning.lay_plan import FULL_TURN, LayPlan
from winding_core.lay.guide_path import lay_of
from winding_core.markers import is_wound
from winding_core.run_inputs import no_inputs

Array = NDArray[np.float64]

_PERIOD = 0.02  # Between these the solver takes a cubic [s]
# Steps of the fit of a lag, and how far aside a trial lies, as a share of it.
_FITS = 4
_ASIDE = 1.0e-4


@dataclass(frozen=True, kw_only=True)
class SolverLay:
    """Where the rod lies after a plan."""

    theta: Array  # Wound angles of its nodes on the cylinder, ascending [rad], shape (k,)
    z: Array  # Axial position there [m], shape (k,)
    residual: Array  # z less what is wanted there [m], shape (k,)
    markers: Array  # Wound angle of P1..Pn [rad], shape (n,); nan for one that has not landed

    def rms(self) -> float:
        """Root mean square of the residual after the first turn [m], as `LayPlan.rms`."""
        late = self.theta >= (FULL_TURN if self.theta[-1] >= 2.0 * FULL_TURN else 0.0)
        return float(np.sqrt(np.mean(self.residual[late] ** 2)))

    @property
    def worst(self) -> tuple[float, float]:
        """Largest distance from what is wanted [m], and where [rad]."""
        at = int(np.argmax(np.abs(self.residual)))
        return float(abs(self.residual[at])), float(self.theta[at])

    def z_at(self, theta: Array) -> Array:
        """Return z [m] of the laid cable at wound angles [rad], shape (m,); nan where none lies."""
        return np.asarray(np.interp(theta, self.theta, self.z, right=np.nan))


def wind_plan(plan: LayPlan, config: WindingConfig) -> SolverLay:
    """Wind a plan with the rod.

    Raises:
        SolverError: The integration failed, see `RodWinding`.
        ValueError: The rod cannot be right about it.
    """
    rows = plan.samples(plan.times(_PERIOD))
    inputs = no_inputs(rows.t.size)
    inputs["t"] = rows.t
    inputs["cylinder_angle"], inputs["angular_speed"] = rows.cylinder, rows.cylinder_speed
    inputs["carriage_position"], inputs["feed_speed"] = rows.guide, rows.guide_speed
    inputs["tension"] = rows.span
    model = RodWinding(config)
    model.compile()
    replay(inputs, model)
    _, theta, z = model.wound_path()
    markers = model.markers()
    landed = np.where(is_wound(markers), markers["theta"], np.nan)[1:]
    return SolverLay(theta=theta, z=z, residual=z - plan.program.z_at(theta), markers=landed)


def plan_with_solver(
    plan_with: Callable[[float | None], LayPlan], config: WindingConfig
) -> tuple[LayPlan, SolverLay]:
    """Return a plan with the rod's own lag, and where the rod lies after it.

    The first plan, with the lag of a thread, is kept where the rod lies no worse after it.

    Args:
        plan_with: Returns the plan for a lag [rad], or for that of a thread.
        config: Model of what the plan winds.

    Raises:
        SolverError: The integration failed, see `RodWinding`.
        ValueError: The rod cannot be right about it.
    """
    plan = plan_with(None)
    laid = wind_plan(plan, config)
    nearer = plan_with(solver_lag(plan, laid))
    again = wind_plan(nearer, config)
    return (nearer, again) if again.rms() < laid.rms() else (plan, laid)


def solver_lag(plan: LayPlan, solver: SolverLay) -> float:
    """Return the lag [rad] with which the lag law comes nearest to what the rod did.

    Bending lets the cable leave the cylinder elsewhere than a thread would: the rod's lag is a few
    per cent off free length over radius.
    """
    _, theta, guide = plan.motion.grid()
    lag = plan.lag
    for _ in range(_FITS):
        trial, beside = (
            np.interp(solver.theta, theta, lay_of(theta, guide, value))
            for value in (lag, lag * (1.0 + _ASIDE))
        )
        slope = (beside - trial) / (lag * _ASIDE)
        weight = float(slope @ slope)
        if weight == 0.0:
            break
        lag += float(slope @ (solver.z - trial)) / weight
        lag = min(max(lag, 0.5 * plan.lag), 2.0 * plan.lag)
    return lag
