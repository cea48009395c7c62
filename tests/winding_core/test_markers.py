from __future__ import annotations

import math

import numpy as np
import pytest

from winding_core.helix import curve_length
from winding_core.markers import (
    CORRECTED_DTYPE,
    MARKER_DTYPE,
    MarkerFlag,
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


def test_every_marker_lies_on_the_centreline_cylinder() -> None:
    markers = _wound()
    # Single precision of a 17 mm coordinate.
    np.testing.assert_allclose(np.hypot(markers["x"], markers["y"]), RADIUS, rtol=2e-7)
    np.testing.assert_array_equal(markers["r"], RADIUS)


def test_a_marker_lands_at_azimuth_zero_when_the_cylinder_has_turned_its_angle() -> None:
    landing = _wound(cylinder_angle=12.52)[2]
    assert float(landing["x"]) == pytest.approx(RADIUS, rel=1e-7)
    assert float(landing["y"]) == pytest.approx(0.0, abs=1e-9)


def test_turning_on_carries_wound_cable_towards_positive_y() -> None:
    assert _wound(cylinder_angle=12.52 + 0.1)[2]["y"] > 0.0


def test_the_fixed_end_turns_with_the_cylinder() -> None:
    p0 = _wound(cylinder_angle=0.5 * math.pi)[0]
    assert float(p0["x"]) == pytest.approx(0.0, abs=1e-9)
    assert float(p0["y"]) == pytest.approx(RADIUS, rel=1e-7)


def test_turning_the_cylinder_changes_neither_angle_nor_length() -> None:
    before, after = _wound(20.0), _wound(23.0)
    for name in ("theta", "s", "z"):
        np.testing.assert_array_equal(before[name], after[name])


def test_s_is_the_curve_length_of_theta_and_z() -> None:
    markers = _wound()
    np.testing.assert_array_equal(
        markers["s"],
        curve_length(RADIUS, np.array([0.0, 6.28, 12.52]), np.array([0.0, 0.0045, 0.01486])),
    )


def test_an_angle_beyond_one_turn_is_not_wrapped() -> None:
    assert _wound()["theta"].tolist() == [0.0, 6.28, 12.52]


def test_nothing_wound_gives_no_records() -> None:
    assert _wound(ids=[], theta=[], z=[]).shape == (0,)


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


@pytest.mark.parametrize("dtype", [MARKER_DTYPE, CORRECTED_DTYPE])
def test_fields_fill_a_record_without_overlap(dtype: np.dtype) -> None:
    spans = sorted((offset, kind.itemsize) for kind, offset in dtype.fields.values())
    ends = [offset + size for offset, size in spans]
    assert all(end <= begin for end, (begin, _) in zip(ends, spans[1:], strict=False))
    # Doubles stay aligned, or every reader pays for it.
    assert all(offset % size == 0 for offset, size in spans)


def test_a_radius_that_cannot_be_is_refused() -> None:
    with pytest.raises(ValueError, match="radius must be positive"):
        _wound(radius=-0.017)
