"""Marker records lie on the cylinder, and markers look as they were named."""

from __future__ import annotations

import math

import numpy as np
import pytest

from winding_core.helix import curve_length
from winding_core.markers import (
    CORRECTED_DTYPE,
    MARKER_DTYPE,
    MarkerFlag,
    MarkerLook,
    is_wound,
    wound_markers,
)

RADIUS = 0.017


def _wound(cylinder_angle: float = 20.0, **changes):
    given = {
        "ids": [0, 1, 2],
        "theta": [0.0, 6.28, 12.52],
        "z": [0.0, 0.0045, 0.01486],
        "radius": RADIUS,
        "cylinder_angle": cylinder_angle,
    }
    return wound_markers(**{**given, **changes})


@pytest.mark.parametrize("turned", [12.52, 12.62, 0.5 * math.pi, 23.0])
def test_markers_turn_on_the_centreline_cylinder_and_keep_angle_and_length(turned: float) -> None:
    markers = _wound(cylinder_angle=turned)
    theta, z = np.array([0.0, 6.28, 12.52]), np.array([0.0, 0.0045, 0.01486])
    # A marker lands at azimuth 0 at its own angle; single precision of a 17 mm coordinate.
    for name, wanted in (("x", np.cos(turned - theta)), ("y", np.sin(turned - theta))):
        np.testing.assert_allclose(markers[name], RADIUS * wanted, atol=2e-9)
    np.testing.assert_array_equal(markers["r"], RADIUS)
    np.testing.assert_array_equal(markers["theta"], theta)
    np.testing.assert_array_equal(markers["s"], curve_length(RADIUS, theta, z))
    np.testing.assert_allclose(markers["z"], z, rtol=1e-7)


def test_flags_are_kept_and_tell_what_is_wound() -> None:
    markers = _wound(flags=[0, MarkerFlag.TOUCHING, MarkerFlag.NOT_WOUND | MarkerFlag.PREDICTED])
    assert is_wound(markers).tolist() == [True, True, False]


def test_each_flag_is_a_bit_of_its_own() -> None:
    assert sum(MarkerFlag) == int(np.bitwise_or.reduce([int(flag) for flag in MarkerFlag]))


def test_a_corrected_record_begins_as_a_marker_record() -> None:
    for name in MARKER_DTYPE.names or ():
        assert CORRECTED_DTYPE.fields[name][:2] == MARKER_DTYPE.fields[name][:2]
    assert MARKER_DTYPE.itemsize == 64
    assert CORRECTED_DTYPE.itemsize == 96
    assert set(CORRECTED_DTYPE.names) - set(MARKER_DTYPE.names) == {"s_fem", "h", "s_low", "s_high"}


def test_without_colours_all_markers_have_one() -> None:
    assert MarkerLook().hues == ()


def test_names_and_hues_may_be_mixed() -> None:
    assert MarkerLook(marker_colours="Red, 48,blue").hues == (0.0, 48.0, 230.0)
