"""PID speed controller with feedforward, saturation and anti-windup."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class PidConfig:
    """Gains of one axis.

    Attributes:
        proportional: [V per unit of speed error]
        integral: [V per unit of speed error and second]
        derivative: [V per unit of measured acceleration]
        limit: Largest output magnitude [V].
        tracking_time: Time in which a saturated integrator is led back [s].
    """

    proportional: float
    integral: float
    derivative: float
    limit: float
    tracking_time: float

    def __post_init__(self) -> None:
        if not self.limit > 0.0:
            raise ValueError(f"limit must be positive, got {self.limit} V")
        if not self.tracking_time > 0.0:
            raise ValueError(f"tracking_time must be positive, got {self.tracking_time} s")


@dataclass(kw_only=True)
class PidState:
    """Integrator `integral` [V] and the speed last `measured` [rad/s or m/s]."""

    integral: float = 0.0
    measured: float | None = None


def step_pid(
    config: PidConfig,
    state: PidState,
    *,
    setpoint: float,
    measured: float,
    feedforward: float,
    dt: float,
) -> float:
    """Return the output [V] of one control step of dt [s].

    The derivative acts on the measurement, so that a setpoint step gives no kick. When the
    output saturates, the integrator follows what the actuator really got (back-calculation).
    """
    error = setpoint - measured
    acceleration = 0.0 if state.measured is None else (measured - state.measured) / dt
    state.measured = measured
    wanted = (
        feedforward
        + config.proportional * error
        + state.integral
        - config.derivative * acceleration
    )
    output = min(max(wanted, -config.limit), config.limit)
    state.integral += dt * (config.integral * error + (output - wanted) / config.tracking_time)
    return output
