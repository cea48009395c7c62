"""Runs, recordings and films are read as arrays; the command wrote them."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cable_winding as cw


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


def test_a_film_without_a_camera_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="brings no camera: give camera="):
        cw.track(tmp_path, cw.Condition(case=4))


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
