import dataclasses

import numpy as np
import pytest

from correction_node.live.corrector import Corrector
from correction_node.models.dataset import load_data_set
from correction_node.models.weights import load_factor, weights_directory
from correction_node.training.protocol import learn_places
from winding_core.cable.cases import paper_case
from winding_core.markers import CORRECTED_DTYPE, MarkerFlag, Markers, wound_markers

CORRECTOR = Corrector(load_factor(weights_directory("paper")))
CASE = paper_case(7)


def _markers() -> Markers:
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


def _on_path(beside: float) -> Markers:
    """Return markers so far [m] beside the path that places were learned on."""
    factor, theta = CORRECTOR.factor(CASE), _markers()["theta"]
    z = np.array(factor.z_path) + np.array(factor.z_slope) * CASE.centreline_radius * theta[1:]
    return wound_markers(
        ids=[0, 1, 2, 3, 4],
        theta=theta,
        z=[0.0, *(z + beside)],
        radius=CASE.centreline_radius,
        cylinder_angle=30.0,
    )


def test_z_beside_the_path_stays_the_prediction_s() -> None:
    markers = _on_path(5.0e-3)
    np.testing.assert_array_equal(CORRECTOR.correct(markers, CASE)["z"], markers["z"])


def test_place_and_length_are_one() -> None:
    markers = _on_path(0.0)
    corrected = CORRECTOR.correct(markers, CASE)
    for name in ("id", "r", "flags"):
        np.testing.assert_array_equal(corrected[name], markers[name])
    # z and x, y are single precision: 4 nm at 60 mm.
    one_length = np.hypot(corrected["r"] * corrected["theta"], corrected["z"])
    np.testing.assert_allclose(one_length, corrected["s"], rtol=1e-9, atol=1e-9)
    azimuth = 30.0 - corrected["theta"]
    np.testing.assert_allclose(corrected["x"], corrected["r"] * np.cos(azimuth), atol=2e-8)
    np.testing.assert_allclose(corrected["y"], corrected["r"] * np.sin(azimuth), atol=2e-8)
    assert (corrected["sigma_theta"][1:] > 0.0).all()
    assert (corrected["sigma_z"][1:] > 0.0).all()


def test_places_of_the_shipped_weights_are_right_for_cases_left_out() -> None:
    trained = load_factor(weights_directory("rod"))
    cells = load_data_set("rod").cells
    h = np.concatenate([trained.card["h_left_out"][str(case)] for case in range(1, 13)])
    found, card = learn_places(cells, h)
    assert found is not None
    left_out = card["place"]["left_out"]
    assert left_out == trained.card["place"]["left_out"]
    # Asked of the correction; the prediction misses by 0.71 rad and 2.43 mm.
    assert left_out["theta_rad"] <= 0.25
    assert left_out["z_mm"] <= 1.5


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
    assert CORRECTOR.refusals(markers, CASE) == ()


def _with_length(length: float) -> Markers:
    markers = _markers()
    markers["s"][2] = length
    return markers


def _numbered(*ids: int) -> Markers:
    markers = _markers()
    markers["id"] = ids
    return markers


@pytest.mark.parametrize(
    ("markers", "kept", "sentence"),
    [
        (_with_length(np.nan), [0, 1, 3, 4], "marker 2 has no usable length, got nan m"),
        (_with_length(np.inf), [0, 1, 3, 4], "marker 2 has no usable length, got inf m"),
        (_with_length(-0.1), [0, 1, 3, 4], "marker 2 has no usable length, got -0.1 m"),
        # P2 of case 7 is 400 mm of cable; a marker of 5 % less may be thinning.
        (_with_length(0.37), [0, 1, 3, 4],
         "marker 2 is shorter than physics allows: 0.37 m of cable that measures 0.4 m"),
        (_with_length(1.7), [0, 1, 3, 4],
         "marker 2 is longer than the material's tables reach: 1.7 m of cable that measures"),
        (_with_length(1.01 * _markers()["s"][3]), [0, 1, 2, 4],
         "marker 3 lies before marker 2: 0.5885 m against 0.5944 m"),
        (_markers()[[0, 1, 2, 2, 3]], [0, 1, 2, 3], "marker 2 stands twice"),
        (_numbered(0, 1, 2, 3, 9), [0, 1, 2, 3], "marker 9 does not exist: this cable has 4"),
        (_markers()[[0, 1, 3, 4]], [0, 1, 3, 4],
         "marker 2 is missing, though a later one is wound"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)  # fmt: skip
def test_an_impossible_marker_is_refused(markers: Markers, kept: list[int], sentence: str) -> None:
    assert CORRECTOR.correct(markers, CASE)["id"].tolist() == kept
    assert CORRECTOR.refusals(markers, CASE)[0].startswith(sentence)


def test_the_order_of_records_does_not_matter() -> None:
    markers = _markers()[::-1]
    assert CORRECTOR.refusals(markers, CASE) == ()
    assert CORRECTOR.correct(markers, CASE)["id"].tolist() == [4, 3, 2, 1, 0]


def test_nothing_in_gives_nothing_out() -> None:
    assert CORRECTOR.correct(_markers()[:0], CASE).shape == (0,)
    assert CORRECTOR.refusals(_markers()[:0], CASE) == ()


def test_every_marker_has_its_own_h_where_the_model_gives_one() -> None:
    corrector = Corrector(load_factor(weights_directory("rod")))
    by_marker = corrector.factor(CASE).by_marker
    assert len(set(by_marker)) == 4
    corrected = corrector.correct(_markers(), CASE)
    assert corrected["h"].tolist() == [by_marker[0], *by_marker]
    np.testing.assert_array_equal(corrected["s"], corrected["h"] * corrected["s_fem"])
