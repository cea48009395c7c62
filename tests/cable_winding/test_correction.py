"""The correction as an estimator: shipped weights, own fits, and conditions outside them."""

from pathlib import Path

import numpy as np
import pytest

import cable_winding as cw


@pytest.fixture(scope="module")
def shipped() -> cw.Correction:
    return cw.Correction.load("rod")


def test_the_measured_lengths_are_training_data() -> None:
    x, y, groups = cw.load_lengths()
    assert x.shape == (45, len(cw.FEATURES))
    assert y.shape == groups.shape == (45,)
    assert set(groups) == set(range(1, 13))
    # h, measured over predicted, stays within a quarter.
    assert (abs(y / x[:, 5] - 1.0) < 0.25).all()


def test_shipped_weights_halve_the_error_of_the_prediction(shipped: cw.Correction) -> None:
    x, y, _ = cw.load_lengths()
    corrected = shipped.predict(x)
    # In-sample 0.74 % against 4.5 %.
    assert abs(y / corrected - 1.0).mean() < 0.5 * abs(y / x[:, 5] - 1.0).mean()
    low, high = shipped.predict_interval(x)
    assert ((low < corrected) & (corrected < high)).all()
    assert ((low < y) & (y < high)).all()
    assert shipped.errors_["in_sample_pct"] < shipped.errors_["leave_one_case_out_pct"]


@pytest.mark.slow
def test_a_prediction_is_corrected_as_its_rows_are(shipped: cw.Correction) -> None:
    run = cw.predict(cw.Condition(case=4, duration=8.0))
    case = run.condition.resolved().case
    own = (case.cylinder_diameter, case.cable_diameter, case.weight, case.marker_spacing)
    rows = [(*own, n, run.markers.s[n]) for n in (1, 2)]
    assert run.markers.wound.tolist() == [True, True, True, False, False]
    np.testing.assert_allclose(shipped.predict(run), shipped.predict(rows), rtol=1e-12)


@pytest.mark.slow
def test_another_material_is_not_corrected(shipped: cw.Correction) -> None:
    run = cw.predict(cw.Condition(case=4, duration=8.0, young=5e6))
    np.testing.assert_array_equal(shipped.predict(run), run.markers.s[1:3])


def test_outside_the_box_h_is_one_and_the_interval_wide(shipped: cw.Correction) -> None:
    inside = (45e-3, 4e-3, 3.0, 0.1, 1, 0.11)
    outside = (100e-3, 4e-3, 3.0, 0.1, 1, 0.11)
    corrected = shipped.predict([inside, outside])
    assert corrected[0] != 0.11
    assert corrected[1] == 0.11
    low, high = shipped.predict_interval([inside, outside])
    width = (high - low) / corrected
    assert width[1] > 3.0 * width[0]


@pytest.mark.slow
def test_a_fit_learns_the_rig_and_is_stored(tmp_path: Path) -> None:
    x, y, groups = cw.load_lengths()
    own = cw.Correction("rig").fit(x, y, groups)
    before = abs(y / x[:, 5] - 1.0).mean()
    assert abs(y / own.predict(x) - 1.0).mean() < 0.5 * before
    own.save(tmp_path / "weights")
    again = cw.Correction.load(tmp_path / "weights")
    assert again.model == "rig"
    np.testing.assert_array_equal(again.predict(x), own.predict(x))


def test_an_unfitted_correction_refuses_to_predict() -> None:
    x, _, _ = cw.load_lengths()
    with pytest.raises(ValueError, match="not fitted: call fit or load first"):
        cw.Correction().predict(x)


@pytest.mark.parametrize("wrong", [np.zeros(6), np.zeros((3, 5))], ids=["flat", "narrow"])
def test_a_wrong_shape_is_refused(shipped: cw.Correction, wrong: np.ndarray) -> None:
    with pytest.raises(ValueError, match="X must have the columns cylinder_diameter"):
        shipped.predict(wrong)
