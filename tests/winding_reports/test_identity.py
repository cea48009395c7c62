from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone

import pytest

from winding_core.cable.condition import Condition
from winding_reports.records.identity import Identity, Origin, condition_quantities
from winding_reports.records.run_record import run_json
from winding_reports.run_report.report import render_report

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
