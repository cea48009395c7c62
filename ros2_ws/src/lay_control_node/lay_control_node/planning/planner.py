"""From a program to the machine's motion: path, rounding, motion, lay, pulls, in this order."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lay_control_node.planning.lay_on import StretchedCable
from lay_control_node.planning.lay_plan import LayPlan
from lay_control_node.planning.marker_pulls import PullPlan, PullPlanner, Track
from lay_control_node.planning.motion import motion_along
from lay_control_node.planning.out_of_reach import sentences_of
from lay_control_node.programs.feasibility import refuse_beyond, refuse_overlap
from winding_core.cable.condition import ResolvedCondition
from winding_core.lay.guide_path import guide_path, lay_of, layer_lag, within
from winding_core.lay.limits import PlanLimits
from winding_core.lay.program import LayProgram, LayProgramError
from winding_core.lay.rounding import (
    USED,
    corners,
    demands,
    needed_width,
    width_within,
    width_without_slip,
)
from winding_core.lay.smoothed_line import smoothed_program

Array = NDArray[np.float64]

_OF_LIMIT = 0.95  # Share of a residual limit that rounding may take
# The pull is planned on samples so far apart [rad].
_TRACK_STEP = 0.02
_STANDING_SAMPLES = 50


def plan_lay(
    program: LayProgram,
    what: ResolvedCondition,
    limits: PlanLimits,
    *,
    residual_limit: float | None = None,
    together: bool = False,
    lag: float | None = None,
    even_cable: bool = False,
) -> LayPlan:
    """Return the motion that lays a program, with what will lie where.

    The cylinder keeps the condition's speed, and corners are rounded as much as the carriage needs
    at that speed and friction holds. It is slower where no rounding helps, and, with a residual
    limit, at corners.

    Args:
        program: What is wanted.
        what: What is wound, and how fast at most.
        limits: Of the machine.
        residual_limit: By how much a corner may be rounded [m]; the cylinder is slowed for it.
        together: Whether guide and cylinder start together, or the guide takes its place first.
        lag: Of the lay behind the guide on the bare cylinder [rad]; None for free length over
            centreline radius.
        even_cable: Whether the cable keeps on every layer the speed that it has on the first, and
            the cylinder turns slower there.

    Raises:
        LayProgramError: Turns would overlap, layers would reach the guide, or the program leaves
            the carriage's travel or asks for a marker that is not on the cable.
        UnreachableError: No motion keeps the limits.
        ValueError: The residual limit is not positive.
    """
    if residual_limit is not None and not residual_limit > 0.0:
        raise ValueError(f"the residual limit must be positive, got {residual_limit} m")
    case = what.case
    if not program.layered:
        refuse_overlap(program, case.cable_diameter)
    refuse_beyond(program, *limits.travel)
    if program.markers and max(program.markers) > case.marker_count:
        raise LayProgramError(
            f"the program wants marker {max(program.markers)} to land, the cable has "
            f"{case.marker_count} markers"
        )
    cable = StretchedCable(what=what)
    lag = what.free_length / cable.wound_radius if lag is None else lag
    rho = cable.wound_radius
    straight = guide_path(program, layer_lag(lag, rho, program.raised[:-1]), 0.0)
    path = within(straight, *limits.travel)
    speed = _steady_speed(program, what.drive.angular_speed, limits)
    by_carriage = needed_width(path, speed, limits)
    line = smoothed_program(program, by_carriage)
    by_friction = width_without_slip(line, rho, what.friction)
    full = max(by_carriage, by_friction)
    line = replace(line, width=full)
    width = full
    if residual_limit is not None:
        width = width_within(line, _OF_LIMIT * residual_limit, full)
    path = replace(path, width=width)

    def share(theta: Array) -> Array:
        """Return the share of the first layer's speed with which the cylinder turns."""
        return np.asarray(rho / (rho + even_cable * program.raised_at(theta)))

    ramp = what.drive.ramp_time
    motion = motion_along(path, program.end, speed, ramp, limits, together=together, share=share)
    t, theta, guide = motion.grid()
    lags = layer_lag(lag, rho, program.raised_at(theta))
    predicted = lay_of(theta, guide, lags[:-1])
    slope = (guide - predicted) / lags
    track, pulls = _pulls(program, cable, limits, (t, theta, slope))
    rounded = replace(line, width=width)
    at_half = width / full * max(needed_width(path, 0.5 * speed, limits), by_friction)
    plan = LayPlan(
        program=program,
        what=what,
        limits=limits,
        lag=lag,
        radius=rho,
        width=width,
        speed=speed,
        motion=motion,
        theta=theta,
        predicted=predicted,
        uncompensated=lay_of(theta, program.z_at(theta), lags[:-1]),
        corners=corners(rounded, replace(line, width=at_half)),
        track=track,
        pulls=pulls,
        sentences=(),
    )
    shares = demands(path, speed, limits)
    if by_friction > by_carriage:
        shares["friction"] = width / full
    return replace(plan, sentences=sentences_of(plan, shares, straight))


def _steady_speed(program: LayProgram, wanted: float, limits: PlanLimits) -> float:
    """Return the cylinder's speed [rad/s] at which the carriage follows the steepest helix."""
    steepest = float(np.abs(np.diff(program.z) / np.diff(program.theta)).max())
    speed = min(wanted, USED * limits.cylinder_speed)
    if steepest * speed > USED**2 * limits.carriage_speed:
        speed = USED**2 * limits.carriage_speed / steepest
    return speed


def _pulls(
    program: LayProgram, cable: StretchedCable, limits: PlanLimits, grid: tuple[Array, Array, Array]
) -> tuple[Track, PullPlan]:
    t, theta, slope = grid
    # The brake settles while the cylinder stands.
    standing = int(np.searchsorted(theta, 0.0, side="right")) - 1
    turning = np.searchsorted(theta, np.arange(0.0, theta[-1], _TRACK_STEP))
    before = np.linspace(0, max(standing, 0), _STANDING_SAMPLES).astype(int)
    kept = np.unique(np.concatenate([before, turning, [theta.size - 1]]))
    raised = program.raised_at(theta[kept])
    track = Track(t=t[kept], theta=theta[kept], slope=slope[kept], raised=raised)
    weight = cable.what.case.weight
    given = program.tension_at(track.theta)
    given = np.where(np.isnan(given), weight, given)
    reach = None
    if limits.brake is None:
        given = np.full(given.shape, weight)
    else:
        given = np.clip(given, *limits.brake)
        low, high = (share * weight for share in limits.pull_share)
        high = cable.highest_pull(min(high, limits.brake[1]))
        reach = (min(max(low, limits.brake[0]), high), high)
    planner = PullPlanner(cable, track, given, limits.brake_time, reach)
    return track, planner.plan(dict(program.markers))
