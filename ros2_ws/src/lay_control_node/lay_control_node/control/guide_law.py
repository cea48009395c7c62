"""Where the guide has to be so that the cable lands on the wanted line."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from lay_control_node.control.lay_filter import LayEstimate

# Share of the bound of h'' by which a slope that makes up an error is planned to be taken back.
_BRAKING_SHARE = 0.5


@dataclass(frozen=True, kw_only=True)
class WantedPoint:
    """What is wanted at a wound angle.

    Attributes:
        z: Height [m].
        slope: Its first derivative, dz/dtheta [m/rad].
        curvature: Its second derivative [m/rad^2].
    """

    z: float
    slope: float
    curvature: float


class WantedLay(Protocol):
    """A wanted lay, smooth enough for a machine with limits."""

    def at(self, theta: float) -> WantedPoint:
        """Return what is wanted at a wound angle [rad]."""
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
    follow is v = w + t2 w'. Where the guide stands says h' already. It is to come to

        v' + k (v - h)      by      h'' = v'' + 4 k (v' + k (v - h) - h'),

    two equal roots of -2 k, and g' = h' + t1 h''. A cable that lands in a curve of z'' is held by
    friction up to z'' = mu rho, and slips beyond: z'' lags behind h'', which is bounded therefore.
    A large error is made up by the root of its size, so that the slope can be taken back in time.

    Attributes:
        radius: Centreline radius rho = R + r [m].
        gain: k, per wound angle [1/rad].
        turning: Bound of h'' [m/rad^2].
    """

    radius: float
    gain: float = 1.5
    turning: float = math.inf

    def command(
        self, wanted: WantedPoint, lay: LayEstimate, guide: float, turned: float
    ) -> GuideCommand:
        """Return where the carriage has to be after the next step.

        Args:
            wanted: At the contact line.
            lay: What is believed there.
            guide: Setpoint of the carriage now [m].
            turned: Wound angle of the step [rad]; one that is not positive moves nothing.
        """
        near = lay.bend_length / self.radius
        far = (lay.free_length - lay.bend_length) / self.radius
        heading = (guide + lay.offset - lay.headed) / far
        slope = wanted.slope + near * wanted.curvature
        missing = wanted.z + near * wanted.slope - lay.headed
        goal = slope + self._made_up(missing)
        turn = _within(wanted.curvature + 4.0 * self.gain * (goal - heading), self.turning)
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


def _within(value: float, most: float) -> float:
    return min(max(value, -most), most)
