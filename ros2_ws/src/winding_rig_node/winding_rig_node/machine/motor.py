"""Geared DC motor with inertia and friction, in the generalised coordinate of its axis."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class MotorConfig:
    """Motor, gear and load reduced to the axis: [rad] for a rotary one, [m] for a linear one.

    Attributes:
        supply: Largest voltage [V].
        resistance: Winding resistance [Ohm].
        torque_constant: Axis torque or force per ampere [N m/A or N/A].
        back_emf: Voltage per axis speed [V s/rad or V s/m].
        inertia: Everything that moves, reduced to the axis [kg m^2 or kg].
        viscous: Friction per speed [N m s/rad or N s/m].
        coulomb: Dry friction [N m or N].
        brake: Dry friction of the holding brake when it is applied [N m or N].
        ripple: Amplitude of the cogging torque [N m or N].
        ripple_period: Way per cogging period [rad or m].
    """

    supply: float
    resistance: float
    torque_constant: float
    back_emf: float
    inertia: float
    viscous: float
    coulomb: float
    brake: float
    ripple: float
    ripple_period: float

    @property
    def speed_per_volt(self) -> float:
        """Steady axis speed per volt without dry friction."""
        return self.torque_constant / (
            self.torque_constant * self.back_emf + self.resistance * self.viscous
        )

    @property
    def time_constant(self) -> float:
        """Mechanical time constant [s]; the electrical one is far shorter and left out."""
        return self.inertia / (
            self.viscous + self.torque_constant * self.back_emf / self.resistance
        )

    @property
    def friction_voltage(self) -> float:
        """Voltage that overcomes the dry friction [V]."""
        return self.coulomb * self.resistance / self.torque_constant


CYLINDER_MOTOR = MotorConfig(
    supply=24.0,
    resistance=2.0,
    torque_constant=2.2,
    back_emf=2.2,
    inertia=0.12,
    viscous=0.05,
    coulomb=0.25,
    brake=12.0,
    ripple=0.02,
    ripple_period=2.0 * math.pi / 36.0,
)
CARRIAGE_MOTOR = MotorConfig(
    supply=60.0,
    resistance=2.0,
    torque_constant=480.0,
    back_emf=480.0,
    inertia=5760.0,
    viscous=40.0,
    coulomb=40.0,
    brake=3000.0,
    ripple=4.0,
    ripple_period=1.0e-3,
)


@dataclass(kw_only=True)
class MotorState:
    """True `position` [rad or m] and `speed` [rad/s or m/s] of the axis."""

    position: float = 0.0
    speed: float = 0.0


def advance_motor(
    config: MotorConfig,
    state: MotorState,
    voltage: float,
    load: float,
    dt: float,
    *,
    braked: bool = False,
) -> None:
    """Advance an axis by dt [s] under a voltage [V] and an opposing load [N m or N].

    With the brake on the drive is cut. Dry friction opposes motion, and holds the axis while
    it can: speed never changes sign within a step because of friction.
    """
    volts = 0.0 if braked else min(max(voltage, -config.supply), config.supply)
    drive = (
        0.0
        if braked
        else config.torque_constant * (volts - config.back_emf * state.speed) / config.resistance
    )
    cogging = config.ripple * math.sin(2.0 * math.pi * state.position / config.ripple_period)
    force = drive - config.viscous * state.speed - load + cogging
    dry = config.coulomb + (config.brake if braked else 0.0)
    free_speed = state.speed + dt * force / config.inertia
    lost_speed = dt * dry / config.inertia
    if abs(free_speed) <= lost_speed:
        new_speed = 0.0
    else:
        new_speed = free_speed - math.copysign(lost_speed, free_speed)
    state.position += 0.5 * dt * (state.speed + new_speed)
    state.speed = new_speed
