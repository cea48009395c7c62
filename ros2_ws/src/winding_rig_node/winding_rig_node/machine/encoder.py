"""Incremental encoder on the motor shaft, and the speed that a drive makes of its counts."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class EncoderConfig:
    """Encoder of one axis.

    Attributes:
        resolution: Axis way per count [rad or m].
        bandwidth: Natural frequency of the tracking loop that estimates speed [Hz].
    """

    resolution: float
    bandwidth: float = 12.0

    def __post_init__(self) -> None:
        if not self.resolution > 0.0:
            raise ValueError(f"encoder resolution must be positive, got {self.resolution}")


# 2048 lines, read fourfold, in front of a 1:25 gear; and on a screw of 5 mm lead.
CYLINDER_ENCODER = EncoderConfig(resolution=2.0 * math.pi / (8192 * 25))
CARRIAGE_ENCODER = EncoderConfig(resolution=5.0e-3 / 8192)


@dataclass(kw_only=True)
class EncoderState:
    """Last count and the tracking loop's estimate.

    Attributes:
        position: Of the last count [rad or m].
        tracked: The loop's position [rad or m].
        speed: The loop's speed [rad/s or m/s].
    """

    position: float = 0.0
    tracked: float = 0.0
    speed: float = 0.0


def read_encoder(
    config: EncoderConfig,
    state: EncoderState,
    position: float | None,
    dt: float,
    *,
    acceleration: float = 0.0,
) -> None:
    """Sample the axis position; update counted position and estimated speed.

    The tracking loop is critically damped and spreads one count over its time constant. Fed with
    the commanded acceleration it follows a ramp of speed without lag. Without a position the
    count stays and the estimate goes on by itself.
    """
    if position is None:
        state.speed += dt * acceleration
        state.tracked += dt * state.speed
        return
    state.position = config.resolution * math.floor(position / config.resolution)
    omega = 2.0 * math.pi * config.bandwidth
    predicted = state.tracked + dt * state.speed
    innovation = state.position + 0.5 * config.resolution - predicted
    state.tracked = predicted + 2.0 * omega * dt * innovation
    state.speed += dt * (acceleration + omega * omega * innovation)
