"""Where the guide has to be so that the cable lands on the wanted line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from lay_control_node.control.lay_filter import LayEstimate

# A carriage at its largest speed would swing about a place that is further off than this [m].
_LARGEST_EXCURSION = 0.015


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
    t2 z' = h - z and t1 h' = g + b - h with t2 = l / rho and t1 = (L - l) / rho. The lay is to
    have the slope s = w' + k (w - z). The guide is where h' = s + t2 s', since then z' goes to s
    at the rate 1 / t2, and the error e = w - z obeys e' = -k e. With a ratio q of believed to true
    t1 what remains is e = (1 - q) w' / (q k).

    Attributes:
        radius: Centreline radius rho = R + r [m].
        gain: k, per wound angle [1/rad].
    """

    radius: float
    gain: float = 1.0

    def command(self, wanted: WantedPoint, lay: LayEstimate) -> GuideCommand:
        """Return where the carriage has to be while the cable lands as estimated."""
        near = lay.bend_length / self.radius
        far = (lay.free_length - lay.bend_length) / self.radius
        slope = (lay.headed - lay.z) / near
        made_up = self.gain * (wanted.z - lay.z + near * (wanted.slope - slope))
        excursion = min(max(far * made_up, -_LARGEST_EXCURSION), _LARGEST_EXCURSION)
        ahead = far * (wanted.slope + near * wanted.curvature)
        return GuideCommand(
            position=lay.headed + ahead + excursion - lay.offset,
            # The rate is that of a guide whose cable lies where it is wanted.
            per_radian=wanted.slope + (near + far) * wanted.curvature,
        )
