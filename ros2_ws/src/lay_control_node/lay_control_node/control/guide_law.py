"""Where the guide has to be so that the cable lands on the wanted line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from lay_control_node.control.lay_filter import LayEstimate


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
    """Makes the lag's own equation of what is wanted: g = z + (L / rho) (w' + k (w - z)) - b.

    With dz/dTheta = (g + b - z) rho / L the error e = w - z then obeys e' = -k e whatever L is,
    as long as it is known; with a ratio q of believed to true L it is e' = (1 - q) w' - q k e,
    which is stable for every q above zero.

    Attributes:
        radius: Centreline radius R + r [m].
        gain: k, per wound angle [1/rad].
    """

    radius: float
    gain: float = 1.0

    def command(self, wanted: WantedPoint, lay: LayEstimate) -> GuideCommand:
        """Return where the carriage has to be while the cable lands as estimated."""
        lag = lay.free_length / self.radius
        error = wanted.z - lay.z
        slope = wanted.slope + self.gain * error
        # The error that this very command leaves shrinks by k e per radian.
        bend = wanted.curvature - self.gain**2 * error
        return GuideCommand(
            position=lay.z + lag * slope - lay.offset, per_radian=slope + lag * bend
        )
