"""An even helix that a law is asked to lay, without a program's limits."""

from dataclasses import dataclass

import numpy as np

from lay_control_node.control.guide_law import WantedPoint


@dataclass(frozen=True)
class EvenHelix:
    slope: float  # dz/dtheta [m/rad]

    def at(self, theta: float) -> WantedPoint:
        """Return what is wanted at a wound angle [rad]."""
        return WantedPoint(z=self.slope * theta, slope=self.slope, curvature=0.0)

    def slopes(self, theta: np.ndarray) -> np.ndarray:
        return np.full(theta.shape, self.slope)
