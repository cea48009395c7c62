"""The guide: the lay that is wanted of it, where it has to be for that, and within which bounds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lay_control_node.control.lay_filter import LayEstimate
from winding_core.cable.condition import ResolvedCondition
from winding_core.lay.limits import PlanLimits
from winding_core.lay.program import LayProgram
from winding_core.lay.rounding import rounded_for
from winding_core.lay.smoothed_line import SmoothedLine
from winding_core.machine.commanded_axis import MotionLimits

Array = NDArray[np.float64]

# Cable that climbs at a flange is held by it and by its neighbours. What is pushed aside there
# pushes the turns after it by up to half a diameter; as one deviation, in diameters.
_HELD = 0.25
# The first layer's cable climbs so far before the second layer begins [rad].
_CLIMBS_WITHIN = 1.5 * math.pi
# Share of the bound of h'' by which a slope that makes up an error is planned to be taken back.
_BRAKING_SHARE = 0.5


@dataclass(frozen=True, kw_only=True)
class WantedPoint:
    """What is wanted at a wound angle."""

    z: float  # Height [m]
    slope: float  # Its first derivative, dz/dtheta [m/rad]
    curvature: float  # Its second derivative [m/rad^2]
    raised: float = 0.0  # Height of the cable there above that on the bare cylinder [m]
    # By how much cable beside it may hold it off the place to which its span leads it [m].
    doubt: float = 0.0
    pull: float = math.nan  # At the guide [N]; nan where the program states none


class WantedLay(Protocol):
    """A wanted lay, smooth enough for a machine with limits."""

    def at(self, theta: float) -> WantedPoint:
        """Return what is wanted at a wound angle [rad]."""
        ...

    def slopes(self, theta: Array) -> Array:
        """Return dz/dtheta wanted at wound angles [rad], shape of the angles [m/rad]."""
        ...


@dataclass(frozen=True, kw_only=True)
class GuideCommand:
    """Where the carriage has to be: `position` [m], and its change `per_radian` [m/rad]."""

    position: float
    per_radian: float


@dataclass(frozen=True, kw_only=True)
class GuideLaw:
    """Makes the equations of the lag of what is wanted, from the lay back to the guide.

    The end of the span is bent over l, so its lag is one of l and one of L - l in a row:
    t2 z' = h - z and t1 h' = g + b - h with t2 = l / rho and t1 = (L - l) / rho. What h has to
    follow is v = w + t2 w'. The place of the guide gives h' already. It is to come to

        v' + k (v - h)      by      h'' = v'' + 4 k (v' + k (v - h) - h'),

    two equal roots of -2 k, and g' = h' + t1 h''. A cable that lands in a curve of z'' is held by
    friction up to z'' = mu rho, and slips beyond: z'' lags behind h'', which is bounded therefore.
    A large error is made up by the root of its size, so that the slope can be taken back in time.
    """

    radius: float  # Centreline radius rho = R + r on the bare cylinder [m]
    gain: float = 1.5  # k, per wound angle [1/rad]
    turning: float = math.inf  # Bound of h'' [m/rad^2]

    def command(
        self, wanted: WantedPoint, lay: LayEstimate, guide: float, turned: float
    ) -> GuideCommand:
        """Return where the carriage has to be after the next step.

        Args:
            wanted: At the contact line.
            lay: Estimate there.
            guide: Setpoint of the carriage now [m].
            turned: Wound angle of the step [rad]; one that is not positive moves nothing.
        """
        radius = self.radius + wanted.raised
        near = lay.bend_length / radius
        far = (lay.free_length - lay.bend_length) / radius
        heading = (guide + lay.offset - lay.headed) / far
        slope = wanted.slope + near * wanted.curvature
        missing = wanted.z + near * wanted.slope - lay.headed
        goal = slope + self._made_up(missing)
        turn = wanted.curvature + 4.0 * self.gain * (goal - heading)
        turn = min(max(turn, -self.turning), self.turning)
        per_radian = heading + far * turn
        return GuideCommand(position=guide + per_radian * max(turned, 0.0), per_radian=per_radian)

    def _made_up(self, missing: float) -> float:
        """Return the slope beside the wanted one [m/rad] for what is missing of a height [m]."""
        gain, braking = self.gain, _BRAKING_SHARE * self.turning
        linear = braking / gain**2
        if abs(missing) <= linear:
            return gain * missing
        return math.copysign(
            math.sqrt(2.0 * braking * abs(missing) - (braking / gain) ** 2), missing
        )


@dataclass(frozen=True, kw_only=True)
class WantedProgram:
    """A program's rounded line; before P0 and after its end the helices go on."""

    program: LayProgram
    line: SmoothedLine
    diameter: float = 0.0  # Of the cable [m]
    weight: float = math.nan  # Pull where a program with tensions states none [N]

    @classmethod
    def of(cls, program: LayProgram, what: ResolvedCondition, limits: PlanLimits) -> WantedProgram:
        """Return a program, rounded for a condition's speed and friction and a machine's limits.

        Raises:
            LayProgramError: Layers would reach the guide.
        """
        line = rounded_for(program, what, limits)
        stated = bool(np.isfinite(program.tension).any())
        return cls(
            program=program,
            line=line,
            diameter=what.case.cable_diameter,
            weight=what.case.weight if stated else math.nan,
        )

    def at(self, theta: float) -> WantedPoint:
        """Return what is wanted at a wound angle [rad]."""
        z, slope, curvature = (float(self.line.at(theta, order)) for order in range(3))
        raised, soon = self.program.raised_at([theta, theta + _CLIMBS_WITHIN]).tolist()
        doubt = _HELD * self.diameter if soon > 0.0 else 0.0
        pull = float(self.program.tension_at(theta))
        return WantedPoint(
            z=z,
            slope=slope,
            curvature=curvature,
            raised=raised,
            doubt=doubt,
            pull=self.weight if math.isnan(pull) else pull,
        )

    def slopes(self, theta: Array) -> Array:
        """Return dz/dtheta wanted at wound angles [rad], shape of the angles [m/rad]."""
        return self.line.at(theta, 1)


# Share of the acceleration with which an axis is planned to stop; the rest is reserve.
_STOPPING_SHARE = 0.8


class BoundedMotion:
    """A setpoint that follows what is wanted as fast as the bounds allow.

    Args:
        bounds: Of the axis.
        position: Where the axis stands when it is taken over.
        speed: How fast it goes then.
    """

    def __init__(self, bounds: MotionLimits, position: float, speed: float) -> None:
        self.bounds = bounds
        self.position = bounds.within(position)  # Setpoint, within the travel
        self.speed = min(max(speed, -bounds.speed), bounds.speed)  # Its rate
        self.limited = False  # Whether the last step fell short of what was wanted
        self._low, self._high = bounds.low, bounds.high

    def wait_for(self, position: float, reach: float) -> None:
        """Stop within a reach [m] of where the axis stands, and the way that braking takes.

        An axis that does not follow would otherwise rush to a setpoint far away when it does again.
        """
        bounds = self.bounds
        reach += self.speed**2 / (2.0 * _STOPPING_SHARE * bounds.acceleration)
        self._low = bounds.within(position - reach)
        self._high = bounds.within(position + reach)

    def follow(self, position: float, speed: float, dt: float) -> None:
        """Move on by dt [s] towards a wanted position and its rate at the end of the step."""
        wanted = min(max(position, self._low), self._high)
        # The rate at which the step would end exactly where the want will be, but no faster
        # than from where the rest of the way can still be braked.
        gap = wanted - self.position
        carried = speed if wanted == position else 0.0
        exact = gap / dt
        closing = carried + self._closing(gap - carried * dt, dt)
        goal = exact if abs(exact - carried) <= abs(closing - carried) else closing
        reachable = self._change(goal, dt)
        short = abs(reachable - exact) > 1.0e-9 + 1.0e-6 * abs(exact)
        self.limited = short or wanted != position
        self._move(reachable, dt)

    def go(self, speed: float, dt: float) -> None:
        """Move on by dt [s] towards a speed."""
        reachable = self._change(speed, dt)
        self.limited = reachable != speed
        self._move(reachable, dt)

    def _closing(self, gap: float, dt: float) -> float:
        """Return the speed from which a gap is braked within it, a step of dt [s] from now on."""
        braking = _STOPPING_SHARE * self.bounds.acceleration
        step = 0.5 * braking * dt
        return math.copysign(math.sqrt(step**2 + 2.0 * braking * abs(gap)) - step, gap)

    def _change(self, goal: float, dt: float) -> float:
        bounds = self.bounds
        lowest = max(-bounds.speed, self._closing(self._low - self.position, dt))
        highest = min(bounds.speed, self._closing(self._high - self.position, dt))
        goal = min(max(goal, lowest), highest)
        most = bounds.acceleration * dt
        return min(max(goal, self.speed - most), self.speed + most)

    def _move(self, speed: float, dt: float) -> None:
        self.position = self.bounds.within(self.position + speed * dt)
        self.speed = speed
