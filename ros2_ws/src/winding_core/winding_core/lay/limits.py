"""What the machine can do, as a plan has to keep it."""

import math
from dataclasses import dataclass

from winding_core.cable.condition import ResolvedCondition
from winding_core.parameters import parameter

_JERK_TIME = 1.0e-3  # Nothing but the drive limits the jerk: full acceleration within so long [s]


@dataclass(frozen=True, kw_only=True)
class PlanLimits:
    """Limits of both axes and of the brake."""

    cylinder_speed: float  # [rad/s]
    cylinder_acceleration: float  # [rad/s^2]
    carriage_speed: float  # [m/s]
    carriage_acceleration: float  # [m/s^2]
    carriage_jerk: float  # [m/s^3]
    travel: tuple[float, float]  # Start and end of the carriage's travel [m]
    # Smallest and largest pull of the brake [N]; None for a dead weight alone.
    brake: tuple[float, float] | None
    brake_time: float  # Its time constant [s]
    # Smallest and largest pull that markers may be steered with, as shares of the weight.
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


@dataclass(frozen=True, kw_only=True)
class GuideBounds:
    """What is commanded of the carriage at most."""

    guide_speed_limit: float = parameter(
        0.08, "largest speed that is commanded of the carriage [m/s]", low=1.0e-4, high=2.0
    )
    guide_acceleration_limit: float = parameter(
        0.5, "largest acceleration that is commanded of the carriage [m/s^2]", low=0.01, high=20.0
    )
    guide_travel: list[float] = parameter(
        [-0.1, 1.0], "start and end of the travel that is commanded [m]", low=-10.0, high=10.0
    )

    def limits(self, what: ResolvedCondition) -> PlanLimits:
        """Return the limits that a program is rounded for.

        Raises:
            ValueError: The travel ends before it begins, or does not hold 0.
        """
        drive, acceleration = what.drive, self.guide_acceleration_limit
        return PlanLimits(
            cylinder_speed=drive.angular_speed,
            cylinder_acceleration=drive.angular_speed / max(drive.ramp_time, _JERK_TIME),
            carriage_speed=self.guide_speed_limit,
            carriage_acceleration=acceleration,
            carriage_jerk=acceleration / _JERK_TIME,
            travel=(self.guide_travel[0], self.guide_travel[1]),
            brake=None,
            brake_time=0.0,
        )
