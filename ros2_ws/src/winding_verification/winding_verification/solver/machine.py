"""A winding model moved by hand: what problems that are posed to the winding steppers share."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from cable_fem_node.dynamics.state import FloatArray
from cable_fem_node.winding.winding_model import WindingModel
from winding_core.readings import AxisReading

# Rounds of Gauss and Newton; five would do.
ROUNDS = 12


class Machine:
    """Moves cylinder, guide and load of a winding model from one standstill to the next.

    Args:
        model: At its start.
        tension: Of the span [N].
        piece: Time between two calls of the model [s].
    """

    def __init__(self, model: WindingModel, tension: float, piece: float = 5.0e-3) -> None:
        self.model = model
        self._tension = tension
        self._piece = piece
        self._angle = 0.0
        self._guide = 0.0

    def move(
        self,
        seconds: float,
        *,
        angle: float | None = None,
        guide: float | None = None,
        tension: float | None = None,
    ) -> None:
        """Move to an angle [rad], a place of the guide [m] and a tension [N]; None stays."""
        a, g, f = self._angle, self._guide, self._tension
        da = 0.0 if angle is None else angle - a
        dg = 0.0 if guide is None else guide - g
        df = 0.0 if tension is None else tension - f
        start, pieces = self.model.time, math.ceil(seconds / self._piece)
        for i in range(1, pieces + 1):
            u = i / pieces
            way, rate = u * u * (3.0 - 2.0 * u), 6.0 * u * (1.0 - u) / seconds
            reading = AxisReading(
                cylinder_angle=a + way * da,
                angular_speed=rate * da,
                carriage_position=g + way * dg,
                feed_speed=rate * dg,
            )
            self.model.advance_to(start + u * seconds, reading, f + way * df)
        self._angle, self._guide, self._tension = a + da, g + dg, f + df

    def spin(self, seconds: float, speed: float, to: float | None = None) -> None:
        """Turn on at a speed [rad/s] that changes steadily to another one."""
        change = (speed if to is None else to) - speed
        a, start, pieces = self._angle, self.model.time, math.ceil(seconds / self._piece)
        for i in range(1, pieces + 1):
            t = seconds * i / pieces
            self._angle = a + speed * t + 0.5 * change * t * t / seconds
            reading = AxisReading(
                cylinder_angle=self._angle,
                angular_speed=speed + change * t / seconds,
                carriage_position=self._guide,
                feed_speed=0.0,
            )
            self.model.advance_to(start + t, reading, self._tension)

    def watch(self, seconds: float, pieces: int, look: Callable[[], Any]) -> FloatArray:
        """Stand still and return what is seen at equal times, shape (pieces, ...)."""
        seen = []
        for _ in range(pieces):
            self.move(seconds / pieces)
            seen.append(look())
        return np.asarray(seen)


def swing(values: FloatArray, spacing: float) -> tuple[float, float, float]:
    """Return period [s], logarithmic decrement and rest of a decaying oscillation.

    The damped sine about a constant that fits best, by Gauss and Newton. Not a number where
    it hardly swings.

    Args:
        values: Displacement at equal times, shape (n,).
        spacing: Time between them [s].
    """
    off = values - values.mean()
    rises = np.flatnonzero((off[:-1] < 0.0) & (off[1:] >= 0.0))
    if rises.size < 3:
        return math.nan, math.nan, math.nan
    t = spacing * np.arange(values.size)
    decay, omega, rest = 0.0, math.tau / (spacing * float(np.diff(rises).mean())), 0.0
    for _ in range(ROUNDS):
        wave = np.exp(-decay * t) * np.stack([np.cos(omega * t), np.sin(omega * t)])
        columns = np.column_stack([*wave, *(t * wave), np.ones_like(t)])
        (a, b, c, d, rest), *_ = np.linalg.lstsq(columns, values, rcond=None)
        square = a * a + b * b
        decay -= (a * c + b * d) / square
        omega += (b * c - a * d) / square
        if not (omega > 0.0 and abs(decay) < omega):
            return math.nan, math.nan, math.nan
    return float(math.tau / omega), float(math.tau * decay / omega), float(rest)
