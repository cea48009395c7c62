"""What is needed to measure a lay."""

import math
from dataclasses import dataclass, field
from typing import NamedTuple

from marker_tracker_node.camera.pinhole import CameraPose
from marker_tracker_node.tracking.refinement import PoseBelief

# Way around the cylinder, in cable diameters, over which a climbing turn can be followed.
FOLLOWED = 0.8

KNOWN = PoseBelief(position=0.0, tilt=0.0)


class Machine(NamedTuple):
    """What the kernels know of cylinder and cable."""

    rho: float  # R + r [m]
    radius: float  # Of the cable [m]
    diameter: float  # Of the cable [m]
    onward: float  # 1 where the winding goes towards +z, -1 otherwise
    free_length: float  # Expected [m]


@dataclass(frozen=True, kw_only=True)
class LayConfig:
    """Configuration of a `LayTracker`."""

    cylinder_radius: float  # R [m]
    cable_radius: float  # r [m]
    # Feed per radian of rotation that the lay is meant to have; its sign is that of the winding
    # along z [m/rad].
    advance_per_radian: float
    free_length: float  # Expected, of the span between guide and contact line [m]
    pose: CameraPose = field(default_factory=CameraPose)  # Where the camera stands
    belief: PoseBelief = KNOWN  # How well that is known; exactly unless stated
    azimuths: int = 5  # Rows of the picture that are measured on the cylinder
    widest: float = 0.7  # Largest azimuth of such a row [rad]
    ways: int = 10  # Rows that are measured on the free span
    longest: float = 0.04  # Largest way before the contact line of such a row [m]
    step: float = 0.08  # Most turning after which a row is measured again [rad], see `turning`
    # Room beyond the intended pitch that counts as a gap, in cable diameters.
    gap_limit: float = 0.25
    # Distance from the turn beneath that counts as an overlap where it is less, in cable diameters.
    overlap_limit: float = 0.88
    climb_limit: float = 0.5  # The same for a turn that lies on others
    roll_doubt: float = 1.0e-3  # How far the picture may be turned about the line of sight [rad]

    def __post_init__(self) -> None:
        for name in ("cylinder_radius", "cable_radius", "free_length", "step", "longest", "widest"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be positive and finite, got {value}")
        if not math.isfinite(self.advance_per_radian):
            raise ValueError(f"advance_per_radian must be finite, got {self.advance_per_radian}")
        if self.azimuths < 1 or self.ways < 0:
            raise ValueError(
                f"azimuths must be at least 1 and ways not negative, got {self.azimuths} and "
                f"{self.ways}"
            )

    @property
    def rho(self) -> float:
        """R + r [m]."""
        return self.cylinder_radius + self.cable_radius

    @property
    def turning(self) -> float:
        """Turning after which a row is measured again [rad].

        A thin cable on a large cylinder may leave its way by its own width sooner than a thick one.
        """
        return min(self.step, FOLLOWED * self.diameter / self.rho)

    @property
    def diameter(self) -> float:
        """Of the cable [m]."""
        return 2.0 * self.cable_radius

    @property
    def onward(self) -> float:
        """1 where the winding goes towards +z, -1 otherwise."""
        return -1.0 if self.advance_per_radian < 0.0 else 1.0

    @property
    def machine(self) -> Machine:
        """As the kernels take it."""
        return Machine(
            *(
                float(value)
                for value in (
                    self.rho,
                    self.cable_radius,
                    self.diameter,
                    self.onward,
                    self.free_length,
                )
            )
        )
