"""Errors of a measured lay and of lengths, and the limits that they are held against."""

import math
from statistics import fmean

import numpy as np
import pytest

from winding_core.cable.cases import published_markers
from winding_core.error_verdict import CAMERA, PAPER_LIMIT_PCT
from winding_core.lay.errors import LayVerdict, WantedLine, judge, lay_errors, turn_errors
from winding_core.lay.records import LAY_DTYPE, LayRecords, cable_lay
from winding_core.markers import CABLE_DTYPE
from winding_reports.records.run_record import MarkerRow, judge_lengths

PITCH, TURN = 18.0e-3, math.tau
ADVANCE = PITCH / TURN
SINGLE = 1.0e-8  # z of the records is single precision: 4 nm at 60 mm


def lay(turns: float, *, off: float = 0.0, step: float = 0.087) -> LayRecords:
    """Return an even helix that lies off by a distance [m]."""
    records = np.zeros(int(turns * TURN / step), LAY_DTYPE)
    records["theta"] = step * (0.5 + np.arange(records.size))
    records["z"] = ADVANCE * records["theta"] + off
    return records


def wanted(turns: float) -> WantedLine:
    return WantedLine.of([0.0, turns * TURN], [0.0, turns * PITCH])


def judged(records: LayRecords, turns: float = 5.0) -> LayVerdict:
    return judge(turn_errors(records, wanted(turns)), 0.5e-3, turns * TURN)


def test_even_offset_is_the_error_of_every_turn() -> None:
    turns = turn_errors(lay(3.0, off=0.2e-3), wanted(3.0))
    assert [turn.number for turn in turns] == [1, 2, 3]
    for turn in turns:
        for value in (turn.mean, turn.rms, turn.largest, turn.measured_z - turn.wanted_z):
            assert value == pytest.approx(0.2e-3, abs=SINGLE)
        assert turn.whole


def test_largest_error_keeps_its_sign_and_its_turn() -> None:
    records = lay(3.0)
    records["z"][100] -= 0.7e-3
    second = turn_errors(records, wanted(3.0))[1]
    assert second.number == int(records["theta"][100] / TURN) + 1 == 2
    assert second.largest == pytest.approx(-0.7e-3, abs=SINGLE)
    assert second.mean == pytest.approx(-0.7e-3 / second.places, abs=SINGLE)


def test_no_error_where_nothing_is_wanted() -> None:
    assert np.isnan(lay_errors(lay(3.0), wanted(2.0))[-1])
    assert [turn.number for turn in turn_errors(lay(3.0), wanted(2.0))] == [1, 2]
    assert turn_errors(lay(3.0), WantedLine.of([], [])) == ()


def test_samples_may_come_in_any_order_and_twice() -> None:
    line = WantedLine.of([2.0, 0.0, 2.0, 1.0, math.nan], [4.0, 0.0, 4.0, 1.0, 9.0])
    np.testing.assert_allclose(line.at([0.5, 1.5]), [0.5, 2.5])


def test_tolerance_is_kept_by_every_turn_after_the_second() -> None:
    records = lay(5.0)
    records["z"][records["theta"] < 2.0 * TURN] += 2.0e-3
    verdict = judged(records)
    assert verdict.kept is True
    assert verdict.sentence.startswith("the lay keeps 0.5 mm in turns 3 to 5: at most 0.00 mm off")
    assert verdict.sentence.endswith("turns 1 and 2, in which the guide gets ahead, are not judged")


@pytest.mark.parametrize(("off", "kept"), [(0.499e-3, True), (0.501e-3, False)])
def test_one_place_decides(off: float, kept: bool) -> None:
    records = lay(5.0)
    records["z"][200] += off
    verdict = judged(records)
    assert verdict.kept is kept
    assert verdict.worst.number == int(records["theta"][200] / TURN) + 1


def test_turn_that_was_not_seen_is_no_kept_turn() -> None:
    records = lay(5.0)
    seen = records[np.abs(records["theta"] - 3.5 * TURN) > 0.3 * TURN]
    verdict = judged(seen)
    assert verdict.kept is None
    assert "turn 4 was not measured all round" in verdict.sentence
    # The same without a single place of it, and at the end of the run.
    unseen = records[np.floor(records["theta"] / TURN) != 3]
    assert judged(unseen).kept is None
    assert judged(lay(3.0)).kept is None


def test_error_is_found_although_a_turn_is_missing() -> None:
    records = lay(5.0, off=0.8e-3)
    unseen = records[np.floor(records["theta"] / TURN) != 3]
    assert judged(unseen).kept is False


def test_run_of_two_turns_is_not_judged() -> None:
    verdict = judged(lay(2.0), 2.0)
    assert verdict.kept is None
    assert "no turn after the second was measured" in verdict.sentence


@pytest.mark.parametrize("oldest", [0.0, 5.0])
@pytest.mark.parametrize("angle", [0.4, 3.0, 33.93, 34.5])
def test_wound_angles_count_from_the_contact_line_back(angle: float, oldest: float) -> None:
    radius, theta = 17.0e-3, np.arange(oldest, angle, 0.31)
    on, free = theta.size, np.arange(1.0, 30.0)
    cable = np.zeros(on + free.size, CABLE_DTYPE)
    cable["x"][:on], cable["y"][:on] = (
        radius * np.cos(angle - theta),
        radius * np.sin(angle - theta),
    )
    cable["z"][:on] = ADVANCE * theta
    # The tangent span to the guide.
    cable["x"][on:] = radius
    cable["y"][on:] = -5.0e-3 * free
    cable["z"][on:] = 1.0
    found, z = cable_lay(cable, angle, radius)
    np.testing.assert_allclose(found, theta, atol=1.0e-6)
    np.testing.assert_allclose(z, ADVANCE * theta, atol=SINGLE)


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


def test_cable_on_cable_is_wound_and_the_span_beside_it_is_not() -> None:
    # Two turns, the second one on the first, and a span that leaves at the contact line.
    theta, turned = np.linspace(0.0, 4.0 * math.pi, 400), 4.0 * math.pi
    radius = np.where(theta < 2.0 * math.pi, 0.032, 0.0355)
    span = np.linspace(0.01, 0.19, 20)
    cable = np.zeros(theta.size + span.size, CABLE_DTYPE)
    cable["x"] = np.append(radius * np.cos(turned - theta), np.full(span.size, 0.0355))
    cable["y"] = np.append(radius * np.sin(turned - theta), -span)
    cable["z"] = np.append(0.001 * theta, np.full(span.size, 1.0))
    found, z = cable_lay(cable, turned, 0.032)
    # Single precision of x and y.
    np.testing.assert_allclose(found, theta, atol=1.0e-5)
    assert z.max() < 0.02
