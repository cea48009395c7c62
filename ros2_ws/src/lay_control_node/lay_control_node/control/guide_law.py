"""Where the guide has to be so that the cable lands on the wanted line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from lay_control_node.control.lay_filter import LayEstimate

# Errors count no further than this: a carriage at its largest speed would swing about them [m].
_LARGEST_ERROR = 3.0e-3


@dataclass(frozen=True, kw_only=True)
class WantedPoint:
    """Wanted height z [m] at a wound angle with its first two derivatives [m/rad, m/rad^2]."""

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
    """Carriage position [m] and its change per wound angle [m/rad]."""

    position: float
    per_radian: float


@dataclass(frozen=True, kw_only=True)
class GuideLaw:
    """Makes the equations of the lag of what is wanted, from the lay back to the guide.

    The end of the span is bent over l, so its lag is one of l and one of L - l in a row:
    z' = (h - z) / t2, h' = (g + b - h) / t1 with t2 = l / rho and t1 = (L - l) / rho. The lay is
    wanted with the slope s = w' + k (w - z), so h is wanted at z + t2 s, and the guide at what
    takes h there at the rate K. With l and L known the error e = w - z obeys e' = -k e once h has
    come to its place.

    Attributes:
        radius: Centreline radius rho = R + r [m].
        gain: k, per wound angle [1/rad].
        inner_gain: K, the same of h [1/rad].
    """

    radius: float
    gain: float = 1.0
    inner_gain: float = 1.5

    def command(self, wanted: WantedPoint, lay: LayEstimate) -> GuideCommand:
        """Return where the carriage has to be while the cable lands as estimated."""
        near = lay.bend_length / self.radius
        far = (lay.free_length - lay.bend_length) / self.radius
        gain, inner = self.gain, self.inner_gain
        slope = (lay.headed - lay.z) / near
        target = lay.z + near * (wanted.slope + gain * _within(wanted.z - lay.z))
        target_slope = slope + near * (wanted.curvature + gain * (wanted.slope - slope))
        rise = target_slope + inner * _within(target - lay.headed)
        # The rate is that of a guide whose cable lies where it is wanted.
        return GuideCommand(
            position=lay.headed + far * rise - lay.offset,
            per_radian=wanted.slope + (near + far) * wanted.curvature,
        )


def _within(error: float) -> float:
    return min(max(error, -_LARGEST_ERROR), _LARGEST_ERROR)
