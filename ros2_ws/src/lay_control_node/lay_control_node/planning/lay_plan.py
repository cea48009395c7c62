"""A planned run: the machine's motion and pull over time, and what will lie where."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lay_control_node.planning.corners import Corner
from lay_control_node.planning.limits import PlanLimits
from lay_control_node.planning.marker_pulls import MarkerLanding, PullPlan, Track
from lay_control_node.planning.motion import Motion
from winding_core.cable.condition import ResolvedCondition
from winding_core.lay.program import LayProgram

Array = NDArray[np.float64]

FULL_TURN = 2.0 * math.pi
# Points per turn at which residuals are compared.
_PER_TURN = 200


@dataclass(frozen=True, kw_only=True)
class PlannedSamples:
    """Both axes and the pull at times.

    Attributes:
        t: [s], shape (m,).
        cylinder: Angle [rad], shape (m,).
        cylinder_speed: [rad/s], shape (m,).
        guide: Position [m], shape (m,).
        guide_speed: [m/s], shape (m,).
        commanded: Pull that is asked for [N], shape (m,).
        pull: Pull that the brake gives [N], shape (m,).
        span: Tension of the span under it [N], shape (m,).
    """

    t: Array
    cylinder: Array
    cylinder_speed: Array
    guide: Array
    guide_speed: Array
    commanded: Array
    pull: Array
    span: Array


@dataclass(frozen=True, kw_only=True)
class LayPlan:
    """What the machine shall do for a program, and what comes of it.

    Attributes:
        program: What is wanted.
        what: What is wound.
        limits: Of the machine.
        lag: Of the lay behind the guide [rad], free length over centreline radius.
        radius: Of the wound cable's centreline [m].
        width: Of the kernel that rounds the corners [rad].
        speed: Of the cylinder where nothing slows it [rad/s].
        motion: Of both axes.
        theta: Wound angles of the prediction, not descending [rad], shape (n,).
        predicted: z of the lay there by the lag law [m], shape (n,).
        uncompensated: z of the lay there with a guide that moves along the program itself [m],
            shape (n,).
        corners: That are rounded.
        track: On which the pull is planned.
        pulls: The pull, and where markers land.
        sentences: What is out of reach, and why.
    """

    program: LayProgram
    what: ResolvedCondition
    limits: PlanLimits
    lag: float
    radius: float
    width: float
    speed: float
    motion: Motion
    theta: Array
    predicted: Array
    uncompensated: Array
    corners: tuple[Corner, ...]
    track: Track
    pulls: PullPlan
    sentences: tuple[str, ...]

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
