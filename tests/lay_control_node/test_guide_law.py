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
    law = GuideLaw(radius=RADIUS, gain=gain, inner_gain=4.0)
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
    # The slower of the two rates is k = 1: exp(-6), and as much again for the approach of h.
    left = error_after(6.0, believed=LENGTH, gain=1.0, start=-2.0e-3, bend=bend)
    assert abs(left) < 2.0e-3 * 2.0 * math.exp(-6.0)


@pytest.mark.parametrize("ratio", [0.7, 1.4])
def test_a_wrong_free_length_leaves_a_steady_error(ratio: float) -> None:
    """h' = q (h*' + K (h* - h)) with q = (L believed - l) / (L - l), and h* - h = t2 k e then.

    On the helix h*' = h' = w', so e = (1 - q) w' / (q K t2 k).
    """
    left = error_after(40.0, believed=ratio * LENGTH, gain=1.0, start=0.0)
    q = (ratio * LENGTH - BEND) / (LENGTH - BEND)
    assert left == pytest.approx((1.0 - q) * PITCH / (q * 4.0 * BEND / RADIUS), rel=1.0e-2)


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
