"""The record of a run: its numbers, and the identity that a report shows."""

from __future__ import annotations

import dataclasses
import json
import math
from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone
from importlib.resources import files

import numpy as np
import pytest

from winding_core.cable.condition import Condition
from winding_reports.records.identity import Identity, Origin, condition_quantities
from winding_reports.records.run_record import (
    MarkerRow,
    MarkerSeries,
    Signal,
    run_json,
    write_run_json,
)
from winding_reports.run_report.report import render_report

SCHEMA = json.loads((files("winding_reports") / "schemas" / "run.json").read_text("utf-8"))
BEGAN = datetime(2026, 3, 1, 1, 30, tzinfo=timezone(timedelta(hours=2)))
ORIGIN = Origin(
    run_id="20260228T233000Z-0badcafe",
    began=BEGAN,
    project_version="0.1.0",
    versions={"python": "3.12.1", "numpy": "2.2.0", "numba": "0.61.0", "rclpy": ""},
    host="cell-7",
)
IDENTITY = Identity(
    origin=ORIGIN,
    seeds=(3,),
    bags=("/data/bag",),
    weights="rod",
    weights_sha256="ab" * 32,
    condition=condition_quantities(Condition(case=4)),
)


def _refuse_constant(name: str) -> None:
    raise AssertionError(f"{name} is not JSON")


def test_the_file_holds_exactly_the_agreed_keys(synthetic, tmp_path) -> None:
    path = tmp_path / "new" / "run.json"
    write_run_json(synthetic(), path)
    read = json.loads(path.read_text(encoding="utf-8"), parse_constant=_refuse_constant)
    assert set(read) == set(SCHEMA["required"])
    assert read["case"] == 4
    assert [marker["id"] for marker in read["markers"]] == [1, 2, 3, 4]
    marker_keys = set(SCHEMA["properties"]["markers"]["items"]["required"])
    assert all(set(marker) == marker_keys for marker in read["markers"])
    assert (read["frames"], read["joint_states_lost"], read["sim_s"]) == (4000, 0, 20.0)


def test_errors_are_the_tables_measure(synthetic) -> None:
    row = MarkerRow(id=1, original=0.1, s_fem=0.125, s_corrected=0.1, s_published=0.11)
    written = run_json(dataclasses.replace(synthetic(), rows=(row,)))["markers"][0]
    # 100 |0.11 - 0.125| / 0.125 and 100 |0.11 - 0.1| / 0.1, exact up to rounding.
    assert written["error_fem_pct"] == pytest.approx(12.0, rel=1e-12)
    assert written["error_corrected_pct"] == pytest.approx(10.0, rel=1e-12)


def test_what_was_not_measured_is_null(synthetic, tmp_path) -> None:
    row = MarkerRow(id=1, original=0.1, s_fem=math.nan, s_tracked=math.inf)
    record = dataclasses.replace(
        synthetic(), rows=(row,), frames=None, frames_lost=None, wall_s=None, sim_s=math.nan
    )
    path = tmp_path / "run.json"
    write_run_json(record, path)
    read = json.loads(path.read_text(encoding="utf-8"), parse_constant=_refuse_constant)
    assert read["markers"][0].pop("id") == 1
    assert read["markers"][0].pop("original_m") == 0.1
    assert set(read["markers"][0].values()) == {None}
    assert [read[name] for name in ("frames", "frames_lost", "wall_s", "sim_s")] == [None] * 4


def test_an_error_needs_a_length_to_divide_by() -> None:
    assert MarkerRow(id=1, original=0.1, s_fem=0.0, s_published=0.1).error_fem_pct is None


def test_numbers_of_numpy_are_written_too(synthetic) -> None:
    row = MarkerRow(id=1, original=0.1, s_fem=np.float64(0.11), h=np.float32(0.5))
    json.dumps(run_json(dataclasses.replace(synthetic(), rows=(row,))))


def test_a_series_gives_one_markers_rows() -> None:
    series = MarkerSeries(
        t=np.array([0.0, 0.0, 1.0]),
        id=np.array([1, 2, 1]),
        theta=np.array([6.0, 12.0, 6.1]),
        z=np.zeros(3),
        s=np.ones(3),
    )
    assert series.of(1).theta.tolist() == [6.0, 6.1]
    assert series.of(3).t.size == 0


def test_series_of_unequal_length_are_refused() -> None:
    with pytest.raises(ValueError, match="one value per stamp"):
        Signal(t=np.zeros(3), value=np.zeros(2))
    with pytest.raises(ValueError, match="theta needs one value per stamp"):
        MarkerSeries(
            t=np.zeros(2), id=np.zeros(2, int), theta=np.zeros(3), z=np.zeros(2), s=np.zeros(2)
        )


def test_date_is_utc_whatever_the_clocks_zone() -> None:
    assert ORIGIN.date == "2026-02-28T23:30:00Z"


def test_time_without_a_zone_is_refused() -> None:
    with pytest.raises(ValueError, match="needs a time zone"):
        replace(ORIGIN, began=BEGAN.replace(tzinfo=None))


def test_recorded_origin_reads_back() -> None:
    assert Origin.from_text(ORIGIN.text) == replace(ORIGIN, began=BEGAN.astimezone(UTC))


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"run_id": 1, "date": "yesterday"}', "null"])
def test_text_that_is_no_origin_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"."):
        Origin.from_text(text)


def test_whole_condition_is_stated_with_units() -> None:
    stated = condition_quantities(Condition(case=4))
    assert (stated["cylinder_diameter_mm"].value, stated["cylinder_diameter_mm"].unit) == (
        30.0,
        "mm",
    )
    assert stated["young_mpa"].text == "2.6 MPa"
    assert stated["case"].value == 4
    assert condition_quantities(Condition(case=4, young=4.0e6))["case"].value == 0


def test_runs_of_different_origin_differ_in_their_identity_alone(synthetic) -> None:
    one = run_json(replace(synthetic(), identity=IDENTITY))
    later = replace(IDENTITY, origin=replace(ORIGIN, run_id="other", host="cell-8"))
    other = run_json(replace(synthetic(), identity=later))
    assert one.pop("identity") != other.pop("identity")
    assert one == other


@pytest.mark.slow
def test_report_names_run_host_versions_seed_recording_and_digest(synthetic) -> None:
    page = render_report(replace(synthetic(), identity=IDENTITY))
    for text in (
        ORIGIN.run_id,
        "2026-02-28T23:30:00Z",
        "cell-7",
        "numpy 2.2.0",
        "rclpy not installed",
        "/data/bag",
        "ab" * 32,
        "1.74 rad/s",
    ):
        assert text in page
