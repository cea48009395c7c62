from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from cable_winding.cases import paper_case
from cable_winding.markers import CORRECTED_DTYPE, MARKER_DTYPE, MarkerFlag, wound_markers
from correction_node.corrector import Corrector
from correction_node.weights import load_weight, weights_directory

CORRECTOR = Corrector(load_weight(weights_directory("paper")))
CASE = paper_case(7)


def _markers():
    return wound_markers(
        ids=[0, 1, 2, 3, 4],
        theta=[0.0, 7.05, 13.91, 18.94, 25.75],
        z=[0.0, 0.00831, 0.02207, 0.03966, 0.05786],
        radius=CASE.centreline_radius,
        cylinder_angle=30.0,
    )


def test_every_length_is_multiplied_by_the_conditions_h() -> None:
    markers = _markers()
    corrected = CORRECTOR.correct(markers, CASE)
    assert corrected.dtype == CORRECTED_DTYPE
    h = CORRECTOR.factor(CASE).h
    # The paper's own factor is 1.386: experiment longer than its simulation by a third.
    assert 1.3 < h < 1.5
    np.testing.assert_array_equal(corrected["h"], h)
    np.testing.assert_array_equal(corrected["s"], h * markers["s"])
    np.testing.assert_array_equal(corrected["s_fem"], markers["s"])


def test_what_is_not_length_stays_the_predictions() -> None:
    markers = _markers()
    corrected = CORRECTOR.correct(markers, CASE)
    for name in set(MARKER_DTYPE.names or ()) - {"s"}:
        np.testing.assert_array_equal(corrected[name], markers[name])


def test_the_interval_holds_the_corrected_length() -> None:
    corrected = CORRECTOR.correct(_markers(), CASE)[1:]
    assert (corrected["s_low"] < corrected["s"]).all()
    assert (corrected["s"] < corrected["s_high"]).all()
    share = corrected["s_high"] / corrected["s"] - 1.0
    np.testing.assert_allclose(share, CORRECTOR.factor(CASE).relative_bound, rtol=1e-12)


def test_the_prediction_is_not_written_to() -> None:
    markers = _markers()
    before = markers.tobytes()
    CORRECTOR.correct(markers, CASE)
    assert markers.tobytes() == before


def test_outside_the_trained_conditions_lengths_pass_with_wide_bounds() -> None:
    strange = dataclasses.replace(CASE, number=0, cylinder_diameter=0.2)
    corrected = CORRECTOR.correct(_markers(), strange)
    np.testing.assert_array_equal(corrected["s"], corrected["s_fem"])
    assert (corrected["s_low"] >= 0.0).all()
    inside = CORRECTOR.correct(_markers(), CASE)
    assert (
        corrected["s_high"][1:] / corrected["s"][1:] > inside["s_high"][1:] / inside["s"][1:]
    ).all()


def test_a_marker_that_is_not_wound_yet_is_left_out_without_complaint() -> None:
    markers = _markers()
    markers["flags"][3:] = MarkerFlag.NOT_WOUND
    markers["s"][4] = np.nan
    assert CORRECTOR.correct(markers, CASE)["id"].tolist() == [0, 1, 2]
    assert CORRECTOR.refusals(markers) == ()


@pytest.mark.parametrize("length", [np.nan, np.inf, -0.1, 0.0])
def test_a_length_that_cannot_be_is_refused_by_name(length: float) -> None:
    markers = _markers()
    markers["s"][2] = length
    assert CORRECTOR.correct(markers, CASE)["id"].tolist() == [0, 1, 3, 4]
    (sentence,) = CORRECTOR.refusals(markers)
    assert "marker 2" in sentence


def test_nothing_in_gives_nothing_out() -> None:
    assert CORRECTOR.correct(_markers()[:0], CASE).shape == (0,)
