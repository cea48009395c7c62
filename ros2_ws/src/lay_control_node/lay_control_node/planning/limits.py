"""What the machine can do, as a plan has to keep it."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class PlanLimits:
    """Limits of both axes and of the brake.

    Attributes:
        brake: Smallest and largest pull of the brake [N]; None for a dead weight alone.
        pull_share: Smallest and largest pull that markers may be steered with, as shares of the
            weight.
    """

    cylinder_speed: float  # [rad/s]
    cylinder_acceleration: float  # [rad/s^2]
    carriage_speed: float  # [m/s]
    carriage_acceleration: float  # [m/s^2]
    carriage_jerk: float  # [m/s^3]
    travel: tuple[float, float]  # Start and end of the carriage's travel [m]
    brake: tuple[float, float] | None
    brake_time: float  # Its time constant [s]
    pull_share: tuple[float, float] = (0.3, 1.5)

    def __post_init__(self) -> None:
        for name in (
            "cylinder_speed",
            "cylinder_acceleration",
            "carriage_speed",
            "carriage_acceleration",
            "carriage_jerk",
        ):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be positive and finite, got {value}")
        if not self.travel[0] <= 0.0 <= self.travel[1]:
            raise ValueError(
                "the carriage's travel must hold 0 mm, where it stands beside P0, "
                f"got {1e3 * self.travel[0]:g} to {1e3 * self.travel[1]:g} mm"
            )
        if self.brake is not None and not 0.0 <= self.brake[0] < self.brake[1]:
            raise ValueError(
                f"the brake's largest pull must exceed its smallest, "
                f"got {self.brake[0]:g} to {self.brake[1]:g} N"
            )
        low, high = self.pull_share
        if not 0.0 < low < high:
            raise ValueError(f"the shares of the pull must ascend from above 0, got {low}, {high}")
        if not self.brake_time >= 0.0:
            raise ValueError(f"brake_time must not be negative, got {self.brake_time} s")
