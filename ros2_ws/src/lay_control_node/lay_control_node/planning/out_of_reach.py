"""What a plan cannot do, and why, in sentences."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np

from lay_control_node.programs.feasibility import crossings
from winding_core.lay.smoothed_line import SmoothedLine, smoothed_program
from winding_core.units import MILLIMETRE

if TYPE_CHECKING:
    from lay_control_node.planning.lay_plan import LayPlan
    from lay_control_node.planning.marker_pulls import MarkerLanding

FULL_TURN = 2.0 * math.pi
_MOST_CORNERS = 6
# Of a turn: a marker that misses its angle by less lands where it is wanted.
LANDED = 1.0e-3
_ROUNDING = 1.0e-6
SLIPPING = 1.25  # Of what friction holds: less slip than this makes is not reported


def sentences_of(
    plan: LayPlan, demands: Mapping[str, float], wanted_path: SmoothedLine
) -> tuple[str, ...]:
    """Return what is out of reach and why, a sentence each.

    Args:
        plan: The plan.
        demands: Of its path at the full cylinder speed, as shares of the carriage's limits,
            dimensionless.
        wanted_path: Of the guide, if its travel were endless.
    """
    return (
        *plan.program.remarks,
        *_speed(plan),
        *_travel(plan, wanted_path),
        *_corners(plan, demands),
        *_slipping(plan),
        *_slowing(plan),
        *_crossings(plan),
        *_tension(plan),
        *(_marker(plan, item) for item in plan.landings if _missed(item)),
    )


def _speed(plan: LayPlan) -> Iterator[str]:
    wanted = plan.what.drive.angular_speed
    if plan.speed >= wanted * (1.0 - _ROUNDING):
        return
    steepest = float(np.abs(np.diff(plan.program.z) / np.diff(plan.program.theta)).max())
    if steepest * wanted <= plan.limits.carriage_speed:
        why = f"it may turn at {plan.limits.cylinder_speed:.4g} rad/s"
    else:
        why = (
            f"a pitch of {FULL_TURN * steepest / MILLIMETRE:.4g} mm would need "
            f"{steepest * wanted / MILLIMETRE:.4g} mm/s of the carriage, which may go "
            f"{plan.limits.carriage_speed / MILLIMETRE:.4g} mm/s"
        )
    yield f"the cylinder turns at {plan.speed:.3g} rad/s instead of {wanted:.4g} rad/s: {why}"


def _travel(plan: LayPlan, wanted_path: SmoothedLine) -> Iterator[str]:
    low, high = plan.limits.travel
    guide = wanted_path.unrounded(plan.theta)
    for limit, beyond, word in ((low, low - guide, "begins"), (high, guide - high, "ends")):
        worst = int(np.argmax(beyond))
        if beyond[worst] > _ROUNDING:
            yield (
                f"the guide would have to go to {guide[worst] / MILLIMETRE:.4g} mm at "
                f"{plan.theta[worst] / FULL_TURN:.3g} turns, its travel {word} at "
                f"{limit / MILLIMETRE:.4g} mm: the lay misses the program there"
            )


def _corners(plan: LayPlan, demands: Mapping[str, float]) -> Iterator[str]:
    limits = plan.limits
    name = max(demands, key=lambda item: demands[item])
    why = {
        "speed": f"the carriage may go {limits.carriage_speed / MILLIMETRE:.4g} mm/s",
        "acceleration": f"the carriage may gain {limits.carriage_acceleration:.4g} m/s in a second",
        "friction": f"friction {plan.what.friction:.4g} holds no sharper turn",
        "jerk": f"the carriage's jerk may be {limits.carriage_jerk:.4g} m/s^3",
    }[name]
    # Every turn of a drum has the same ones.
    most = 1 if plan.program.layered else _MOST_CORNERS
    reported = sorted(plan.corners, key=lambda item: -abs(item.rounding))[:most]
    for corner in sorted(reported, key=lambda item: item.theta):
        text = (
            f"the corner at turn {corner.theta / FULL_TURN:.2f} is rounded by "
            f"{abs(corner.rounding) / MILLIMETRE:.2g} mm"
        )
        if demands[name] > 1.0:
            yield f"{text}, and the cylinder is slowed there"
            continue
        text += f", because {why}"
        if abs(corner.rounding_at_half_speed) < 0.9 * abs(corner.rounding):
            text += (
                f"; at {0.5 * plan.speed:.3g} rad/s of the cylinder it would be "
                f"{abs(corner.rounding_at_half_speed) / MILLIMETRE:.2g} mm"
            )
        yield text
    if len(plan.corners) > len(reported):
        yield f"{len(plan.corners) - len(reported)} more corners are rounded by no more"


def _slowing(plan: LayPlan) -> Iterator[str]:
    lost = plan.motion.lost
    slowest = plan.motion.slowing.slowest
    if slowest < 0.98:
        yield (
            f"the cylinder is slowed down to {slowest:.2g} of its speed, {lost:.2g} s in all, so "
            "that the carriage keeps its limits"
        )


def _slipping(plan: LayPlan) -> Iterator[str]:
    # Cable on a cylinder holds a path of geodesic curvature z''/rho^2 against the pressure of its
    # own curvature 1/rho with friction z''/rho.
    line = smoothed_program(plan.program, plan.width)
    needed = np.abs(line.at(plan.theta, 2)) / (plan.radius + plan.program.raised_at(plan.theta))
    worst = int(np.argmax(needed))
    if needed[worst] > SLIPPING * plan.what.friction:
        yield (
            f"at turn {plan.theta[worst] / FULL_TURN:.2f} the path turns so sharply that the cable "
            f"slips: it needs a friction of {needed[worst]:.2g} and has {plan.what.friction:.2g}, "
            "and the lag law knows no slip"
        )


def _crossings(plan: LayPlan) -> Iterator[str]:
    found = () if plan.program.layered else crossings(plan.program)
    if found:
        yield (
            f"the cable crosses cable that lies there already {len(found)} times, first at turn "
            f"{found[0].theta / FULL_TURN:.2f}: the thickness below is not modelled"
        )


def _tension(plan: LayPlan) -> Iterator[str]:
    asked = plan.program.tension[np.isfinite(plan.program.tension)]
    if not asked.size:
        return
    brake = plan.limits.brake
    if brake is None:
        yield "the program's tension needs a brake: the weight pulls alone"
        return
    if plan.program.markers:
        yield "the pull lands the markers: the program's tension holds before and where none is"
    for value in sorted({float(asked.min()), float(asked.max())}):
        if not brake[0] <= value <= brake[1]:
            yield (
                f"the program asks for a pull of {value:.4g} N, the brake gives "
                f"{brake[0]:.4g} to {brake[1]:.4g} N"
            )


def _missed(item: MarkerLanding) -> bool:
    if math.isnan(item.wanted):
        return False
    return not abs(item.predicted - item.wanted) <= LANDED * FULL_TURN


def _marker(plan: LayPlan, item: MarkerLanding) -> str:
    where = "does not land by the end"
    if math.isfinite(item.predicted):
        where = f"lands at {item.predicted / FULL_TURN:.3f}"
    text = f"marker {item.number} is wanted at {item.wanted / FULL_TURN:.3f} turns and {where}: "
    if plan.limits.brake is None:
        return text + "a dead weight cannot choose the stretch"
    early, late = (
        f"{angle / FULL_TURN:.3f}" if math.isfinite(angle) else "after the end"
        for angle in (item.earliest, item.latest)
    )
    return (
        text + f"with a pull of {item.pull:.3g} N, the nearest of the brake's, it can be landed "
        f"from {early} to {late}"
    )
