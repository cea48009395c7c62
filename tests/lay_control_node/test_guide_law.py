"""The guide's law: wherever the cable lies, it comes back to the wanted line."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lay_control_node.control.guide_law import GuideLaw, WantedPoint
from lay_control_node.control.lay_filter import LayEstimate

RADIUS, LENGTH = 0.032, 0.198
PITCH = 2.87e-3


def error_after(angle: float, *, believed: float, gain: float, start: float) -> float:
    """Wind an angle [rad] with a believed free length [m]; return what is missing [m]."""
    law = GuideLaw(radius=RADIUS, gain=gain)
    z, step = start, 1.0e-3
    for theta in np.arange(0.0, angle, step):
        lay = LayEstimate(theta=theta, z=z, free_length=believed, offset=0.0, covariance=np.eye(3))
        wanted = WantedPoint(z=PITCH * theta, slope=PITCH, curvature=0.0)
        z += (law.command(wanted, lay).position - z) * RADIUS / LENGTH * step
    return PITCH * angle - z


def test_an_error_dies_out_with_the_gain() -> None:
    # e' = -k e: Euler's step of 1 mrad is off by k step / 2 of the exponent.
    left = error_after(3.0, believed=LENGTH, gain=1.5, start=-2.0e-3)
    assert left == pytest.approx(2.0e-3 * math.exp(-4.5), rel=0.01)


@pytest.mark.parametrize("ratio", [0.7, 1.4])
def test_a_wrong_free_length_leaves_what_the_formula_says(ratio: float) -> None:
    """e' = (1 - q) w' - q k e, so e = (1 - q) w' / (q k) in the end."""
    left = error_after(20.0, believed=ratio * LENGTH, gain=1.0, start=0.0)
    assert left == pytest.approx((1.0 - ratio) * PITCH / ratio, rel=1.0e-3)


def test_the_rate_is_the_derivative_of_the_position() -> None:
    """On a closed loop, position over wound angle has the slope that the command says."""
    law = GuideLaw(radius=RADIUS, gain=0.8)
    lag = LENGTH / RADIUS

    def commanded(theta: float, z: float) -> tuple[float, float]:
        lay = LayEstimate(theta=theta, z=z, free_length=LENGTH, offset=1.0e-4, covariance=np.eye(3))
        wanted = WantedPoint(z=1.0e-3 * theta**2, slope=2.0e-3 * theta, curvature=2.0e-3)
        found = law.command(wanted, lay)
        return found.position, found.per_radian

    z, step = 1.0e-3, 1.0e-6
    position, rate = commanded(1.0, z)
    moved = z + (position + 1.0e-4 - z) / lag * step
    later, _ = commanded(1.0 + step, moved)
    # Forward difference over 1e-6 rad, and rounding.
    assert (later - position) / step == pytest.approx(rate, rel=1.0e-4)
