"""The record of a run with its identity, and the report that shows it."""

import json
import math
import re
from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone
from importlib.resources import files

import numpy as np
import pytest
from accessibility import grave_findings, opened
from chromium import chromium
from report_page import ReportPage

from winding_core.cable.cases import Case, paper_case
from winding_core.cable.condition import Condition
from winding_core.error_verdict import PAPER_LIMIT_PCT
from winding_core.markers import MARKER_DTYPE
from winding_core.units import MILLIMETRE
from winding_reports.documents.picture import MOST_POINTS, broken, thinned
from winding_reports.records.identity import Identity, Origin, condition_quantities
from winding_reports.records.run_record import (
    MarkerRow,
    MarkerSeries,
    Signal,
    judge_lengths,
    run_json,
    write_run_json,
)
from winding_reports.run_report.machine_pictures import _mean_over, tracking
from winding_reports.run_report.report import render_report, write_report

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


@pytest.fixture(scope="module")
def page_text(synthetic) -> str:
    return render_report(synthetic())


@pytest.mark.slow
def test_the_page_is_one_file_that_loads_nothing(synthetic, tmp_path) -> None:
    path = write_report(synthetic(), tmp_path / "deep" / "report")
    assert path == tmp_path / "deep" / "report" / "index.html"
    assert list(path.parent.iterdir()) == [path]
    page = ReportPage(path.read_text(encoding="utf-8"))
    page.require_whole()
    assert len(page.sources) == 5


def test_outcome_is_the_first_text_of_the_page(synthetic, page_text: str) -> None:
    body = re.sub(r"<[^>]+>", "", page_text.partition("<body>")[2]).split()
    outcome = synthetic().outcome
    expected = ". ".join(
        (f"{outcome.verdict.value} {outcome.sentences[0]}", *outcome.sentences[1:])
    )
    assert " ".join(body).casefold().startswith(expected.casefold())


def test_the_table_has_every_marker_and_every_number(synthetic, page_text: str) -> None:
    record = synthetic()
    rows = [row for row in ReportPage(page_text).cells if row and row[0].startswith("P")]
    assert [row[0] for row in rows] == ["P1", "P2", "P3", "P4"]
    for text, row in zip(rows, record.rows, strict=True):
        numbers = [float(value) for value in text[1:6] + text[7:]]
        expected = [
            row.original / MILLIMETRE,
            row.s_fem / MILLIMETRE,
            row.s_tracked / MILLIMETRE,
            row.h,
            row.s_corrected / MILLIMETRE,
            row.s_published / MILLIMETRE,
            row.error_fem_pct,
            row.error_corrected_pct,
        ]
        # Printed to 0.01.
        assert numbers == pytest.approx(expected, abs=0.0051)


@pytest.mark.slow
def test_solid_stands_beside_the_rod_s_run_ahead(synthetic) -> None:
    record = synthetic()
    rows = tuple(replace(row, s_rod=0.99 * row.s_fem) for row in record.rows)
    solid = replace(record, element="solid", rod=record.predicted, rows=rows)
    page = ReportPage(render_report(solid))
    shown = [row for row in page.cells if row and row[0].startswith("P")]
    for text, row in zip(shown, rows, strict=True):
        numbers = [float(value) for value in text[2:4]]
        # Printed to 0.01.
        assert numbers == pytest.approx([1e3 * row.s_fem, 1e3 * row.s_rod], abs=0.0051)
    page.require_whole()
    written = run_json(solid)["markers"]
    assert [marker["s_rod_m"] for marker in written] == [row.s_rod for row in rows]
    assert not any("s_rod_m" in marker for marker in run_json(record)["markers"])


@pytest.mark.slow
def test_the_same_run_gives_the_same_bytes(synthetic, page_text: str) -> None:
    assert render_report(synthetic()) == page_text


@pytest.mark.slow
def test_markers_that_were_never_wound_are_dashes(synthetic) -> None:
    page = render_report(synthetic(paper_case(8)))
    row = next(cells for cells in ReportPage(page).cells if cells and cells[0] == "P4")
    assert row == ["P4", "800.00", *["–"] * 8]


@pytest.mark.slow
def test_a_condition_of_ones_own_has_no_published_columns_to_show(synthetic) -> None:
    own = Case(cylinder_diameter=0.045, cable_diameter=0.003, weight=2.5, marker_spacing=0.15)
    page = render_report(synthetic(own))
    assert "Own condition" in page
    assert len(ReportPage(page).sources) == 5


@pytest.mark.slow
def test_a_run_that_left_nothing_still_gives_a_page(synthetic) -> None:
    rows = (MarkerRow(id=1, original=0.1),)
    lengths = judge_lengths(rows, PAPER_LIMIT_PCT, published=True)
    signals = ("cylinder_speed", "carriage_speed", "cylinder_setpoint", "carriage_setpoint")
    counts = ("frames", "frames_lost", "joint_states", "joint_states_lost", "wall_s", "sim_s")
    empty: dict[str, object] = {
        **dict.fromkeys((*signals, "tension"), Signal(t=np.empty(0), value=np.empty(0))),
        **dict.fromkeys(("predicted", "tracked", "corrected"), MarkerSeries.empty()),
        **dict.fromkeys(counts),
    }
    outcome = replace(synthetic().outcome, lengths=lengths)
    page = render_report(
        replace(synthetic(), outcome=outcome, rows=rows, facts={}, notes=(), **empty)
    )
    assert len(ReportPage(page).sources) == 5
    assert "What these numbers are worth" not in page


@pytest.mark.slow
def test_text_from_outside_cannot_become_markup(synthetic) -> None:
    outside = {"notes": ("<script>alert(1)</script>",), "facts": {"<b>": '"><img src=x>'}}
    page = ReportPage(render_report(replace(synthetic(), **outside)))
    assert "script" not in page.tags
    assert page.sources
    assert all(source.startswith("data:") for source in page.sources)


@pytest.mark.slow
def test_losses_are_reported(synthetic) -> None:
    assert "17 lost" in render_report(replace(synthetic(), frames_lost=17))


def test_thinning_loses_no_peak() -> None:
    t = np.linspace(0.0, 20.0, 20001)
    value = np.sin(t)
    value[12345] = 9.0
    value[777] = -9.0
    thin_t, thin = thinned(t, value)
    assert len(thin) <= MOST_POINTS
    assert (thin.max(), thin.min()) == (9.0, -9.0)
    assert (np.diff(thin_t) > 0.0).all()
    assert np.isin(thin_t, t).all()


def test_no_line_is_drawn_across_a_gap() -> None:
    t = np.concatenate([np.arange(0.0, 1.0, 0.005), np.arange(3.6, 4.6, 0.005)])
    drawn_t, drawn = broken(t, np.ones(t.size))
    assert np.flatnonzero(np.isnan(drawn)).tolist() == [200]
    assert np.isnan(drawn_t[200])
    np.testing.assert_array_equal(np.delete(drawn_t, 200), t)


def test_a_signal_without_gaps_stays_whole() -> None:
    t = np.arange(0.0, 1.0, 0.005)
    assert np.isfinite(broken(t, t)[1]).all()
    assert broken(t[:1], t[:1])[0].tolist() == [0.0]


def test_tracking_is_measured_after_the_ramp_only() -> None:
    t = np.arange(0.0, 10.0, 0.01)
    value = np.where(t < 1.0, 0.0, np.where(t.round(6) % 0.02 < 0.005, 2.02, 1.98))
    # Half of the samples one percent above, half below: one percent rms, one percent above.
    assert (
        tracking(Signal(t=t, value=value), 2.0, 1.0) == "1.00 % rms (highest sample 1.0 % above it)"
    )


def test_a_mean_over_time_needs_a_full_stretch() -> None:
    t = np.arange(0.0, 2.0005, 0.001)
    value = np.where(t < 2.0, 1.0, 9.0)
    middle, mean = _mean_over(t, value, 0.5)
    # The one sample at two seconds is no mean of half a second.
    np.testing.assert_allclose(middle, [0.2495, 0.7495, 1.2495, 1.7495])
    np.testing.assert_allclose(mean, 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("width", [1280, 390])
def test_axe_finds_nothing_grave(synthetic, tmp_path, width: int) -> None:
    report = write_report(synthetic(), tmp_path)
    with chromium() as browser:
        shown = opened(browser, report.as_uri(), width=width, dark=False)
        assert grave_findings(shown) == []


def test_the_file_holds_exactly_the_agreed_keys(synthetic, tmp_path) -> None:
    path = tmp_path / "new" / "run.json"
    write_run_json(synthetic(), path)
    read = json.loads(path.read_text(encoding="utf-8"), parse_constant=pytest.fail)
    assert set(read) == set(SCHEMA["required"])
    assert read["case"] == 4
    assert [marker["id"] for marker in read["markers"]] == [1, 2, 3, 4]
    marker_keys = set(SCHEMA["properties"]["markers"]["items"]["required"])
    assert all(set(marker) == marker_keys for marker in read["markers"])
    assert (read["frames"], read["joint_states_lost"], read["sim_s"]) == (4000, 0, 20.0)


def test_errors_are_the_tables_measure(synthetic) -> None:
    row = MarkerRow(id=1, original=0.1, s_fem=0.125, s_corrected=0.1, s_published=0.11)
    written = run_json(replace(synthetic(), rows=(row,)))["markers"][0]
    # 100 |0.11 - 0.125| / 0.125 and 100 |0.11 - 0.1| / 0.1, exact up to rounding.
    assert written["error_fem_pct"] == pytest.approx(12.0, rel=1e-12)
    assert written["error_corrected_pct"] == pytest.approx(10.0, rel=1e-12)


def test_what_was_not_measured_is_null(synthetic, tmp_path) -> None:
    row = MarkerRow(id=1, original=0.1, s_fem=math.nan, s_tracked=math.inf)
    record = replace(
        synthetic(), rows=(row,), frames=None, frames_lost=None, wall_s=None, sim_s=math.nan
    )
    path = tmp_path / "run.json"
    write_run_json(record, path)
    read = json.loads(path.read_text(encoding="utf-8"), parse_constant=pytest.fail)
    assert read["markers"][0].pop("id") == 1
    assert read["markers"][0].pop("original_m") == 0.1
    assert set(read["markers"][0].values()) == {None}
    assert [read[name] for name in ("frames", "frames_lost", "wall_s", "sim_s")] == [None] * 4


def test_an_error_needs_a_length_to_divide_by() -> None:
    assert MarkerRow(id=1, original=0.1, s_fem=0.0, s_published=0.1).error_fem_pct is None


def test_numbers_of_numpy_are_written_too(synthetic) -> None:
    row = MarkerRow(id=1, original=0.1, s_fem=np.float64(0.11), h=np.float32(0.5))
    text = json.dumps(run_json(replace(synthetic(), rows=(row,))))
    (marker,) = json.loads(text)["markers"]
    assert (marker["s_fem_m"], marker["h"]) == (0.11, 0.5)


def test_a_series_gives_one_markers_rows() -> None:
    records = np.zeros(3, dtype=MARKER_DTYPE)
    records["id"], records["theta"] = [1, 2, 1], [6.0, 12.0, 6.1]
    series = MarkerSeries.of_records(np.array([0.0, 0.0, 1.0]), records)
    assert series.of(1).theta.tolist() == [6.0, 6.1]
    assert series.of(3).t.size == 0


def test_series_of_unequal_length_are_refused() -> None:
    with pytest.raises(ValueError, match="one value per stamp"):
        Signal(t=np.zeros(3), value=np.zeros(2))
    with pytest.raises(ValueError, match="theta needs one value per stamp"):
        replace(MarkerSeries.empty(), theta=np.zeros(3))


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
    stated = (ORIGIN.run_id, "2026-02-28T23:30:00Z", "cell-7", "numpy 2.2.0", "rclpy not installed")
    for text in (*stated, "/data/bag", "ab" * 32, "1.74 rad/s"):
        assert text in page
