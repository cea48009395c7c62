"""The guide's law: wherever the cable lies, it comes back to the wanted line."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lay_control_node.control.guide_law import GuideLaw, WantedPoint
from lay_control_node.control.lay_filter import LayEstimate

RADIUS, LENGTH, BEND = 0.032, 0.198, 0.01
PITCH = 2.87e-3


def error_after(
    angle: float, *, believed: float, gain: float, start: float, bend: float = BEND
) -> float:
    """Wind an angle [rad] with a believed free length [m]; return what is missing [m]."""
    law = GuideLaw(radius=RADIUS, gain=gain)
    # The span points along the wanted helix from the place where it lands.
    z, headed, step = start, start + bend / RADIUS * PITCH, 5.0e-4
    for theta in np.arange(0.0, angle, step):
        lay = LayEstimate(
            theta=theta,
            z=z,
            headed=headed,
            free_length=believed,
            bend_length=bend,
            offset=0.0,
            covariance=np.eye(4),
        )
        wanted = WantedPoint(z=PITCH * theta, slope=PITCH, curvature=0.0)
        guide = law.command(wanted, lay).position
        z, headed = (
            z + (headed - z) * RADIUS / bend * step,
            headed + (guide - headed) * RADIUS / (LENGTH - bend) * step,
        )
    return PITCH * angle - z


@pytest.mark.parametrize("bend", [2.0e-3, 1.0e-2, 2.0e-2])
def test_an_error_dies_out_whatever_the_cable_is_bent_over(bend: float) -> None:
    left = error_after(6.0, believed=LENGTH, gain=1.0, start=-2.0e-3, bend=bend)
    # Rates k = 1 and 1 / t2: e = e0 (exp(-T) - t2 exp(-T / t2)) / (1 - t2), and a tenth for
    # Euler's steps.
    near = bend / RADIUS
    exact = 2.0e-3 * (math.exp(-6.0) - near * math.exp(-6.0 / near)) / (1.0 - near)
    assert abs(left) == pytest.approx(exact, rel=0.1)


@pytest.mark.parametrize("ratio", [0.7, 1.4])
def test_a_wrong_free_length_leaves_a_steady_error(ratio: float) -> None:
    """On the helix w' = q (w' + k e), q being the ratio of believed to true L - l."""
    left = error_after(30.0, believed=ratio * LENGTH, gain=1.0, start=0.0)
    q = (ratio * LENGTH - BEND) / (LENGTH - BEND)
    assert left == pytest.approx((1.0 - q) * PITCH / q, rel=1.0e-2)


def test_the_rate_is_that_of_the_guide_on_the_wanted_line() -> None:
    law = GuideLaw(radius=RADIUS)
    lay = LayEstimate(
        theta=1.0,
        z=0.0,
        headed=0.0,
        free_length=LENGTH,
        bend_length=BEND,
        offset=1.0e-4,
        covariance=np.eye(4),
    )
    wanted = WantedPoint(z=1.0e-3, slope=2.0e-3, curvature=2.0e-3)
    # g = w + (L / rho) w' + terms of w'', which is constant.
    assert law.command(wanted, lay).per_radian == pytest.approx(2.0e-3 + LENGTH / RADIUS * 2.0e-3)
