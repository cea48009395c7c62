from __future__ import annotations

from statistics import fmean

import pytest

from winding_core.cable.cases import published_markers
from winding_core.error_verdict import CAMERA, PAPER_LIMIT_PCT, judge_lengths
from winding_reports.records.run_record import MarkerRow


def row(marker: int, fem: float, corrected: float, held_out: float | None = None) -> MarkerRow:
    """A marker of 100 mm whose lengths are too short by so many percent of themselves."""
    return MarkerRow(
        id=marker,
        original=0.09,
        s_fem=0.1 / (1.0 + fem / 100.0),
        h_held_out=None if held_out is None else (1.0 + fem / 100.0) / (1.0 + held_out / 100.0),
        s_corrected=0.1 / (1.0 + corrected / 100.0),
        s_published=0.1,
    )


def test_largest_error_is_held_against_the_limit_and_worse_markers_are_named() -> None:
    rows = [row(1, 4.0, 1.0), row(2, 4.0, 0.5), row(3, 1.0, 2.0), row(4, 0.5, 3.0)]
    verdict = judge_lengths(rows, 2.5, published=True)
    assert verdict.good is False
    assert verdict.sentence == (
        "not good: largest error 3.00 %, limit 2.5 %, marker P4; the correction helped on 2 of 4 "
        "and made P3 and P4 worse"
    )
    assert judge_lengths(rows, 3.1, published=True).good is True


def test_default_limit_is_what_the_papers_correction_leaves() -> None:
    printed = [m.updated_error_pct for m in published_markers() if m.updated_error_pct is not None]
    assert len(printed) == 45
    assert round(fmean(printed), 1) == PAPER_LIMIT_PCT


def test_held_out_error_stands_beside_the_in_sample_one() -> None:
    verdict = judge_lengths([row(1, 4.0, 0.2, 5.0), row(2, 4.0, 0.3, 1.0)], 4.8, published=True)
    assert verdict.good is True
    assert verdict.held_out_sentence == (
        "These errors are in-sample; with this case held out of the training the largest is "
        "5.00 %, marker P1, above the limit"
    )
    written = verdict.as_json()
    assert written["marker_held_out"] == 1
    assert written["largest_error_held_out_pct"] == pytest.approx(5.0, rel=1e-9)
    assert [item["error_held_out_pct"] for item in written["markers"]] == pytest.approx([5.0, 1.0])


def test_without_the_experiment_the_camera_is_the_measure() -> None:
    rows = [MarkerRow(id=1, original=0.1, s_fem=0.125, s_corrected=0.1, s_tracked=0.101)]
    verdict = judge_lengths(rows, 4.8, published=False)
    assert verdict.against == CAMERA
    assert "marker P1, against the camera's lengths;" in verdict.sentence
    # 100 |0.101 - 0.1| / 0.1, exact up to rounding.
    assert verdict.as_json()["largest_error_pct"] == pytest.approx(1.0, rel=1e-9)


def test_run_without_errors_is_neither_good_nor_bad() -> None:
    verdict = judge_lengths([MarkerRow(id=1, original=0.1)], 4.8, published=True)
    assert verdict.good is None
    assert verdict.sentence.startswith("cannot be judged")
    assert verdict.as_json()["marker"] is None
