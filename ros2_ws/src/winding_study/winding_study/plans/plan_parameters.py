"""What a plan may ask of the machine: by default the limits of the simulated machine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from winding_core.lay.limits import PlanLimits
from winding_core.parameters import Spelling, parameter, typed_values
from winding_core.units import (
    ACCELERATION,
    ANGULAR_ACCELERATION,
    ANGULAR_SPEED,
    FORCE,
    JERK,
    LENGTH,
    PLAIN,
    SPEED,
    TIME,
)
from winding_rig_node.machine.commander import CARRIAGE_LIMITS, CYLINDER_LIMITS, CommandLimits

# The simulated carriage has no limit of its own: its acceleration builds up in 50 ms [m/s^3].
CARRIAGE_JERK = CARRIAGE_LIMITS.acceleration / 0.05


@dataclass(frozen=True, kw_only=True)
class PlanParameters:
    """Limits of axes and brake as options."""

    cylinder_speed_limit: float = parameter(
        CYLINDER_LIMITS.speed, "largest cylinder speed", ANGULAR_SPEED, 0.01, 200.0
    )
    cylinder_acceleration_limit: float = parameter(
        CYLINDER_LIMITS.acceleration,
        "largest cylinder acceleration",
        ANGULAR_ACCELERATION,
        0.1,
        2000.0,
    )
    carriage_speed_limit: float = parameter(
        CARRIAGE_LIMITS.speed, "largest carriage speed", SPEED, 1.0e-4, 2.0
    )
    carriage_acceleration_limit: float = parameter(
        CARRIAGE_LIMITS.acceleration, "largest carriage acceleration", ACCELERATION, 0.01, 20.0
    )
    carriage_jerk_limit: float = parameter(
        CARRIAGE_JERK, "largest carriage jerk", JERK, 0.01, 1.0e4
    )
    carriage_travel: list[float] = parameter(
        [CARRIAGE_LIMITS.low, CARRIAGE_LIMITS.high],
        "start and end of the carriage's travel",
        LENGTH,
        -10.0,
        10.0,
    )
    brake: bool = parameter(True, "whether a brake pulls, or the dead weight alone", PLAIN)
    brake_limits: list[float] = parameter(
        [CommandLimits.low_tension, CommandLimits.high_tension],
        "smallest and largest pull of the brake",
        FORCE,
        0.0,
        1000.0,
    )
    brake_time: float = parameter(
        CommandLimits.brake_time, "time constant of the brake", TIME, 0.001, 10.0
    )
    pull_share: list[float] = parameter(
        list(PlanLimits.pull_share),
        "smallest and largest pull that steers markers, as shares of the weight",
        PLAIN,
        0.01,
        10.0,
    )

    @classmethod
    def from_typed(cls, typed: Mapping[str, object], *, spelling: Spelling = str) -> Self:
        """Return the limits that typed options mean.

        Args:
            typed: By option, in the unit of its name.
            spelling: How a refusal writes an option's name.

        Raises:
            ParameterError: A value is refused.
        """
        values: dict[str, Any] = typed_values(cls, typed, spelling)
        return cls(**values)

    def limits(self) -> PlanLimits:
        """Return the limits of a plan.

        Raises:
            ValueError: A range ends before it begins, or the travel does not hold 0.
        """
        return PlanLimits(
            cylinder_speed=self.cylinder_speed_limit,
            cylinder_acceleration=self.cylinder_acceleration_limit,
            carriage_speed=self.carriage_speed_limit,
            carriage_acceleration=self.carriage_acceleration_limit,
            carriage_jerk=self.carriage_jerk_limit,
            travel=(self.carriage_travel[0], self.carriage_travel[1]),
            brake=(self.brake_limits[0], self.brake_limits[1]) if self.brake else None,
            brake_time=self.brake_time,
            pull_share=(self.pull_share[0], self.pull_share[1]),
        )
