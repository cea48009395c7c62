"""State of the page: nodes' health, bounded traces, one run at a time, sources of one moment."""

import math
import re

import numpy as np
import pytest
from axis_readings import axis_reading

from winding_core.cable.condition import Condition
from winding_core.cable.wound_label import WoundLabel
from winding_core.machine.drum import Drum
from winding_core.machine.readings import AxisReading
from winding_core.markers import CABLE_DTYPE, CORRECTED_DTYPE, MarkerFlag, wound_markers
from winding_core.status import Level, Status
from winding_dashboard.drawings.run_charts import speed_drawings
from winding_dashboard.state.health import SILENCE, Health, node_of
from winding_dashboard.state.view_state import SAMPLES, ViewState

# Seconds since 1970.
EPOCH = 1.79e9
NODES = ("winding_rig", "marker_tracker", "cable_fem", "correction")
RADIUS = 0.017


def report(name: str, level: Level = Level.OK, message: str = "") -> Status:
    return Status(name=name, level=level, message=message)


def test_row_shows_the_worst_level_and_every_message() -> None:
    health = Health(["rig"])
    health.note(0.0, [report("rig", message="winding")])
    health.note(0.0, [report("rig: topics", Level.WARN, "refused a message")])
    (row,) = health.rows(1.0)
    assert (row.level, row.message) == (Level.WARN, "winding; refused a message")
    assert health.message("rig") == "winding"


def test_node_that_stops_talking_is_stale() -> None:
    health = Health(["rig"])
    health.note(0.0, [report("rig", Level.OK, "winding")])
    (row,) = health.rows(9.0)
    assert (row.level, row.message) == (Level.STALE, "silent for 9 s")


def test_node_that_was_never_heard_has_its_row() -> None:
    assert Health(["rig"]).rows(0.0)[0].message == "no report yet"


def test_names_of_foreign_requests_cannot_grow_without_end() -> None:
    health = Health(["rig"])
    for number in range(500):
        health.note(0.0, [report(f"stranger{number}"), report(f"rig: part{number}")])
    assert len(health.rows(0.0)) <= 25
    assert health.rows(0.0)[0].name == "rig"


def test_status_names_lead_to_their_node() -> None:
    names = ("rig", "rig: topics", "/winding/rig: topics", " rig : x")
    assert {node_of(name) for name in names} == {"rig"}


def turning(t: float, speed: float = 1.74) -> AxisReading:
    return axis_reading(speed * t, 0.005 * t, speed=speed, feed=0.005)


def markers(angle: float, *flags: int) -> np.ndarray:
    count = len(flags)
    return wound_markers(
        ids=np.arange(count),
        theta=6.0 * np.arange(count),
        z=0.01 * np.arange(count),
        radius=RADIUS,
        cylinder_angle=angle,
        flags=np.array(flags, dtype=int),
    )


@pytest.fixture
def state() -> ViewState:
    return ViewState(nodes=NODES, machine="winding_rig", solver="cable_fem")


def wind(state: ViewState, t: float, now: float = 0.0) -> None:
    state.note_axes(t, turning(t))
    state.note_source("tracked", t, markers(turning(t).cylinder_angle, 0, 0, MarkerFlag.NOT_WOUND))
    state.tick(now)


def test_charts_keep_their_last_minute_however_long_a_run_is(state: ViewState) -> None:
    for sample in range(3 * SAMPLES):
        wind(state, 0.1 * sample)
    assert len(state.speeds) == SAMPLES
    assert len(state.lengths[1]) == SAMPLES
    assert state.speeds[-1][0] == pytest.approx(0.1 * (3 * SAMPLES - 1))


def test_standing_clock_adds_no_samples(state: ViewState) -> None:
    for _ in range(5):
        wind(state, 1.0)
    assert len(state.speeds) == 1


def test_run_is_timed_from_the_first_turn_by_a_clock_from_1970(state: ViewState) -> None:
    assert math.isnan(state.run_time)
    standing = axis_reading()
    for sample in range(30):
        state.note_axes(EPOCH + 0.1 * sample, standing)
        state.tick(0.1 * sample)
    assert state.run_time == 0.0
    for sample in range(21):
        state.note_axes(EPOCH + 2.9 + 0.1 * sample, turning(0.1 * sample))
        state.tick(2.9 + 0.1 * sample)
    assert state.run_time == pytest.approx(2.0)
    # Doubles of such times are a quarter of a microsecond apart.
    labels = re.findall(r">(-?[\d.]+) s<", speed_drawings(state)["chart-speed"])
    assert {"0", "2"} <= set(labels)


def test_marker_that_no_camera_speaks_of_is_not_seen(state: ViewState) -> None:
    state.note_source("predicted", 1.0, markers(turning(1.0).cylinder_angle, 0, 0))
    assert [row.state for row in state.marker_rows()] == ["not seen", *["not wound"] * 3]


def test_clock_that_goes_back_begins_a_new_run_with_the_prediction_kept(state: ViewState) -> None:
    state.ahead = markers(0.0, 0, 0)
    for sample in range(20):
        wind(state, 0.1 * sample)
    wind(state, 0.0)
    assert len(state.speeds) == 1
    assert len(state.ahead) == 2


def test_marker_that_is_not_wound_has_no_length(state: ViewState) -> None:
    wind(state, 1.0)
    rows = {row.id: row for row in state.marker_rows()}
    assert set(rows) == {1, 2, 3, 4}
    assert rows[1].measured == pytest.approx(math.hypot(RADIUS * 6.0, 0.01))
    assert math.isnan(rows[2].measured)
    assert (rows[1].state, rows[2].state) == ("measured", "not wound")
    assert len(state.lengths[2]) == 0


def test_difference_is_taken_from_the_correction_and_its_bounds_are_shown(state: ViewState) -> None:
    wind(state, 1.0)
    measured = state.marker_rows()[0].measured
    corrected = np.zeros(1, CORRECTED_DTYPE)
    corrected["id"], corrected["s"] = 1, measured / 1.02
    corrected["s_low"], corrected["s_high"] = 0.9 * measured, 1.1 * measured
    state.corrected = corrected
    row = state.marker_rows()[0]
    assert row.difference == pytest.approx(0.02)
    assert (row.low, row.high) == pytest.approx((0.9 * measured, 1.1 * measured))


def test_newest_marker_is_followed(state: ViewState) -> None:
    assert state.newest_marker() == 1
    state.note_axes(1.0, turning(1.0))
    state.note_source("tracked", 1.0, markers(1.74, 0, 0, 0, 0))
    state.tick(0.0)
    assert state.newest_marker() == 3


def test_markers_seen_later_than_the_cable_are_turned_back_to_its_moment(state: ViewState) -> None:
    wind(state, 2.0)
    state.note_source("cable", 1.9, np.zeros(0, CABLE_DTYPE))
    assert state.drum_angle == pytest.approx(1.74 * 1.9)
    assert state.marker_turn == pytest.approx(-1.74 * 0.1)


def test_silence_is_noticed(state: ViewState) -> None:
    assert not state.heard(0.0)
    state.health.note(10.0, [Status(name="winding_rig", message="winding")])
    assert state.heard(10.0 + SILENCE)
    assert not state.heard(10.1 + SILENCE)
    assert state.phase == "winding"


def test_run_begins_when_the_cylinder_turns_and_again_after_a_reset(state: ViewState) -> None:
    state.note_axes(5.0, turning(0.0, speed=0.0))
    assert state.run_began == 5.0
    state.note_axes(6.0, turning(0.1))
    state.note_axes(9.0, turning(3.1))
    assert state.run_began == 5.0
    state.clear()
    state.note_axes(12.0, turning(0.0, speed=0.0))
    assert state.run_began == 12.0


def test_who_comes_later_takes_the_way_so_far_for_time(state: ViewState) -> None:
    state.note_axes(100.0, turning(8.0))
    assert state.run_began == pytest.approx(92.0)


@pytest.mark.parametrize("passed", [0.1, 0.4, 1.0, 7.0])
def test_beginning_is_found_within_the_ramp_and_after_it(state: ViewState, passed: float) -> None:
    condition = Condition(case=4, ramp_time=0.5).resolved()
    values = WoundLabel.of(condition).values()
    state.note_axes(100.0, condition.drive.reading_at(passed))
    state.health.note(0.0, [Status(name="cable_fem", values=values)])
    assert state.run_began == pytest.approx(100.0 - passed)


def test_source_is_as_old_as_by_the_machines_clock(state: ViewState) -> None:
    wind(state, 2.0)
    assert state.old("tracked") == 0.0
    state.note_axes(4.5, turning(4.5))
    assert state.old("tracked") == pytest.approx(2.5)
    assert state.old("predicted") == 0.0


@pytest.mark.parametrize("drum", [None, Drum(radius=0.02, width=0.07, flange_height=0.01)])
def test_what_is_wound_is_what_the_solver_reports(state: ViewState, drum: Drum | None) -> None:
    assert state.label is None
    label = WoundLabel.of(Condition(case=9).resolved(), drum)
    state.health.note(0.0, [Status(name="cable_fem", values=label.values())])
    assert state.label == label
