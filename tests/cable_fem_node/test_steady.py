"""When a tracked marker counts as landed and measured."""

import numpy as np
import pytest

from cable_fem_node.identification.steady import SteadyConfig, SteadyMarkers
from winding_core.markers import MarkerFlag, Markers, wound_markers


def frame(theta: float = 6.5, *, flags: int = 0, sigma: float = 2e-3, marker: int = 1) -> Markers:
    return wound_markers(
        ids=[0, marker],
        theta=[0.0, theta],
        z=[0.0, 0.004],
        radius=0.017,
        cylinder_angle=7.0,
        sigma_theta=[0.0, sigma],
        sigma_z=[0.0, 1e-4],
        flags=[0, flags],
    )


def seen(*frames: Markers) -> SteadyMarkers:
    markers = SteadyMarkers(SteadyConfig(frames=20))
    for each in frames:
        markers.add(each)
    return markers


def test_marker_counts_once_enough_frames_have_measured_it() -> None:
    assert seen(*[frame()] * 19).steady() == ()
    assert seen(*[frame()] * 19).readings() is None
    assert seen(*[frame()] * 20).steady() == (1,)


def test_reading_is_the_mean_with_the_deviation_of_one_frame() -> None:
    rng = np.random.default_rng(0)
    draws = 6.5 + 2e-3 * rng.standard_normal(400)
    readings = seen(*[frame(float(theta)) for theta in draws]).readings()
    assert readings is not None
    assert readings.theta[0] == pytest.approx(draws.mean(), abs=1e-12)
    # The frames' 2 mrad and the camera's 1 mrad, which no number of frames averages away.
    assert readings.sigma_theta[0] == pytest.approx(np.hypot(2e-3, 1e-3))


@pytest.mark.parametrize(
    "flag",
    [MarkerFlag.OCCLUDED, MarkerFlag.CLIPPED, MarkerFlag.NOT_WOUND, MarkerFlag.PREDICTED],
)
def test_frames_that_did_not_measure_do_not_count(flag: MarkerFlag) -> None:
    assert seen(*[frame(flags=int(flag))] * 50).steady() == ()


def test_touching_turns_are_measured_all_the_same() -> None:
    assert seen(*[frame(flags=int(MarkerFlag.TOUCHING))] * 20).steady() == (1,)


def test_marker_that_slips_is_left_out_for_good() -> None:
    slipped = frame(flags=int(MarkerFlag.SLIPPED))
    assert seen(*[frame()] * 20, slipped, *[frame()] * 20).steady() == ()


def test_marker_that_wanders_is_not_steady() -> None:
    assert seen(*[frame(6.5 + 2e-3 * i) for i in range(40)]).steady() == ()


def test_nan_is_not_a_measurement() -> None:
    assert seen(*[frame(float("nan"))] * 50).steady() == ()
