"""The public interface: names, predictions, plans, corrections, recordings as arrays."""

import dataclasses
import inspect
import json
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cable_winding as cw
from processes import python

# Case 4 over a third of its time: one marker is wound.
SHORT = cw.Condition(case=4, marker_spacing=30e-3, duration=6.0)
PROBE = """
import json, sys
import cable_winding
heavy = ("numpy", "numba", "scipy", "cv2", "torch", "rclpy", "rosbags", "pyarrow", "matplotlib")
print(json.dumps([name for name in heavy if name in sys.modules]))
"""


@pytest.fixture(scope="module")
def run() -> cw.Prediction:
    return cw.predict(SHORT)


@pytest.mark.slow
def test_arrays_have_the_shapes_that_are_documented(run: cw.Prediction) -> None:
    frames, count, nodes = len(run.t), 5, len(run.cable.s)
    assert len(run.markers) == count
    assert run.markers.xyz.shape == (count, 3)
    assert run.theta.shape == run.z.shape == run.s.shape == (frames, count)
    assert run.cable.xyz.shape == (nodes, 3)
    assert run.cable.tension.shape == run.cable.strain.shape == run.cable.twist.shape == (nodes,)
    assert run.cable_per_turn.shape == run.pitch_per_turn.shape
    assert run.t[-1] == pytest.approx(SHORT.duration)
    np.testing.assert_array_equal(run.s[-1], run.markers.s)
    assert run.markers.wound.all()


@pytest.mark.slow
def test_a_length_is_that_of_the_wound_helix(run: cw.Prediction) -> None:
    radius = np.hypot(*run.markers.xyz[:, :2].T)
    # Markers lie on one radius, the positions are in single precision.
    np.testing.assert_allclose(radius, radius.mean(), rtol=1e-6)
    assert (run.markers.s[1:] > radius.mean() * run.markers.theta[1:]).all()
    assert run.stretch == pytest.approx(run.stretch_closed_form, rel=2e-3)
    assert 0.0 <= run.energy_balance < 0.01


@pytest.mark.slow
def test_more_pull_lays_the_markers_further_apart(run: cw.Prediction) -> None:
    def heavier(weight: float, cylinder_diameter: float, wound_length: float) -> float:
        return 1.2 * weight

    assert (cw.predict(SHORT, tension_law=heavier).markers.s[1:] > run.markers.s[1:]).all()


@pytest.mark.slow
def test_the_modulus_is_identified_from_its_own_prediction(run: cw.Prediction) -> None:
    guess = dataclasses.replace(SHORT, young=2.0e6)
    found = cw.identify(guess, run.markers)
    assert found.warning == ""
    assert found.law == "linear"
    # The inverse problem is posed to the solver that wound it: far inside the stated interval.
    assert found.young == pytest.approx(SHORT.young, abs=0.2 * found.half_width_90)
    assert found.id.tolist() == [1, 2, 3, 4]
    assert found.residual.shape == (4,)


CASE_4 = cw.Condition(case=4)
DRUM = cw.DrumPlanParameters(drum_width=0.06, flange=0.02)


@pytest.mark.parametrize(
    ("ask", "sentence"),
    [
        (lambda: cw.predict(cw.Condition(case=0, cylinder_diameter=40e-3)),
         "missing cable_diameter, weight or nominal_stress"),
        (lambda: cw.identify([SHORT], ["one", "two"]), "2 runs need as many conditions, got 1"),
        (lambda: cw.plan(CASE_4, "lay.yaml", turns=3), "leave them out with a program"),
        (lambda: cw.plan(CASE_4, pitch=0.018, turns=4, drum=DRUM),
         r"would leave the drum after 3\.111 turns"),
        (lambda: cw.plan(CASE_4, turns=4, drum=dataclasses.replace(DRUM, layers=2)),
         "a drum has a program of its own"),
        (lambda: cw.Correction().predict(cw.load_lengths()[0]),
         "not fitted: call fit or load first"),
        (lambda: cw.track(Path(__file__).parent, CASE_4), "brings no camera: give camera="),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_in_a_sentence(ask: Callable[[], Any], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        ask()


def test_a_planned_helix_lies_where_it_is_wanted() -> None:
    found = cw.plan(cw.Condition(case=4), pitch=8e-3, turns=4, markers_every_turn=True)
    assert found.t.shape == found.cylinder.shape == found.guide.shape == found.tension.shape
    assert found.theta.shape == found.z.shape == found.residual.shape
    np.testing.assert_allclose(found.z_wanted, 8e-3 * found.theta / (2.0 * np.pi), atol=1e-12)
    # The law of the lag is inverted exactly for a helix.
    assert abs(found.residual).max() < 1e-9
    assert found.landings == {n: pytest.approx(2.0 * np.pi * n, abs=1e-3) for n in (1, 2, 3, 4)}
    assert found.warnings == ()


def test_a_drum_is_planned_layer_by_layer() -> None:
    drum = cw.DrumPlanParameters(drum_width=0.06, flange=0.02, layers=3)
    found = cw.plan(cw.Condition(case=4), drum=drum)
    d = 4.0e-3
    rises = np.unique(np.round(found.radius - found.radius[0], 9))
    assert rises == pytest.approx(np.arange(3) * np.sqrt(3.0) / 2.0 * d, rel=1e-6)
    # P0 lies against a flange; corners are rounded towards the inside.
    assert found.z_wanted.min() == 0.0
    assert found.z_wanted.max() == pytest.approx(0.06 - d)
    # The cable keeps its speed: the cylinder is slowest on the outermost layer.
    speed = np.gradient(found.cylinder, found.t)
    middle = speed[found.t.size // 6], speed[found.t.size // 2], speed[5 * found.t.size // 6]
    assert middle[0] > middle[1] > middle[2] > 0.0


def test_a_tensile_test_is_fitted_by_every_law() -> None:
    strain = np.linspace(0.02, 0.2, 10)
    fits = cw.fit_tensile(strain, 2.6e6 * strain)
    assert fits[0].law == "linear"
    assert fits[0].young == pytest.approx(2.6e6)
    assert [item.aicc for item in fits] == sorted(item.aicc for item in fits)


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


@pytest.mark.parametrize("wrong", [np.zeros(6), np.zeros((3, 5))], ids=["flat", "narrow"])
def test_a_wrong_shape_is_refused(shipped: cw.Correction, wrong: np.ndarray) -> None:
    with pytest.raises(ValueError, match="X must have the columns cylinder_diameter"):
        shipped.predict(wrong)


def test_an_import_brings_nothing_that_is_not_used() -> None:
    assert json.loads(python(PROBE, check=True, timeout=60.0).stdout) == []


def test_the_version_is_that_of_the_project() -> None:
    assert cw.__version__ == version("cable-winding-twin")


@pytest.mark.parametrize("name", cw.__all__)
def test_a_public_name_is_documented_and_listed(name: str) -> None:
    thing = getattr(cw, name)
    assert name in dir(cw)
    if name == "FEATURES":
        return
    text = inspect.getdoc(thing)
    assert text
    if inspect.isclass(thing) and thing.__module__.startswith("cable_winding"):
        for field in dataclasses.fields(thing) if dataclasses.is_dataclass(thing) else ():
            assert f"{field.name}:" in text, field.name
    elif inspect.isfunction(thing):
        for parameter in inspect.signature(thing).parameters:
            assert f"{parameter}:" in text, parameter


def test_a_wrong_name_is_refused_as_python_does() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'predikt'"):
        cw.predikt  # noqa: B018


@pytest.mark.processes
@pytest.mark.slow
def test_a_run_and_its_recording_hold_the_same_lengths(recorded_run: Any) -> None:
    run = cw.read_run(recorded_run.json)
    rows = json.loads(recorded_run.json.read_text(encoding="utf-8"))["markers"]
    assert run.id.tolist() == [row["id"] for row in rows]
    assert run.s_fem[0] == rows[0]["s_fem_m"]
    assert run.record["markers"] == rows
    topics = cw.list_topics(recorded_run.bag)
    assert topics["/winding/fem/markers"] == "sensor_msgs/msg/PointCloud2"
    marker = cw.read_bag(recorded_run.bag, "fem/markers")
    assert len({column.shape for column in marker.values()}) == 1
    newest = marker["s"][marker["id"] == 1][-1]
    assert newest == pytest.approx(run.s_fem[0], abs=1e-4)


@pytest.mark.processes
@pytest.mark.slow
def test_a_recording_is_tracked_again_and_its_cable_identified(recorded_run: Any) -> None:
    condition = cw.Condition(case=4)
    tracked = cw.track(recorded_run.bag, condition)
    run = cw.read_run(recorded_run.json)
    # Within 0.2 % of the length, as the tracker promises for P1.
    assert tracked.markers.s[1] == pytest.approx(run.s_tracked[0], rel=2e-3)
    assert tracked.theta.shape == tracked.flags.shape == (len(tracked.t), 5)
    assert tracked.frame.shape[2] == 3
    found = cw.identify(condition, recorded_run.bag)
    # The paper's P1 of case 4 lies like that of a cable stiffer than the tabulated 2.6 MPa.
    assert found.warning == ""
    assert 3.5e6 < found.young < 5.5e6
    assert found.id.tolist() == [1]


def test_lengths_of_a_run_are_columns(tmp_path: Path) -> None:
    row = {"original_m": 0.1, "s_fem_m": 0.112, "s_tracked_m": None, "h": 0.95}
    rows = [{"id": 1, **row, "s_corrected_m": 0.106, "s_published_m": None}]
    (tmp_path / "run.json").write_text(json.dumps({"markers": rows}), encoding="utf-8")
    run = cw.read_run(tmp_path)
    assert (run.id.tolist(), run.original.tolist(), run.s_fem.tolist()) == ([1], [0.1], [0.112])
    assert (run.s_corrected.tolist(), run.h.tolist()) == ([0.106], [0.95])
    assert np.isnan(run.s_tracked).all()
    assert np.isnan(run.s_published).all()


@pytest.mark.parametrize("text", ["{}", '{"markers": [{"id": 1}]}', "[]"])
def test_what_is_no_run_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "run.json").write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match="is not the record of a run"):
        cw.read_run(tmp_path)


def test_markers_of_a_message_are_read_by_their_fields() -> None:
    from sensor_msgs.msg import PointCloud2

    from winding_core.markers import wound_markers
    from winding_ros.messages.clouds import encode_cloud
    from winding_ros.messages.serialised import deserialised

    records = wound_markers(
        ids=[0, 1], theta=[0.0, 6.5], z=[0.0, 9e-3], radius=25e-3, cylinder_angle=7.0
    )
    markers = cw.Markers.from_message(deserialised(encode_cloud(1.0, records), PointCloud2))
    assert markers.id.tolist() == [0, 1]
    assert markers.wound.all()
    for name in ("theta", "z", "s", "sigma_theta"):
        np.testing.assert_array_equal(getattr(markers, name), records[name])
