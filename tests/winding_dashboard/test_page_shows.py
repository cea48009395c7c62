"""Snapshots of a run, from the real view state, through the page's real server."""

import asyncio
import math
from typing import Any

import numpy as np
import pytest
from axis_readings import axis_reading
from controlled_page import note_run
from simulated_page import NODES, NOW, Clock, Desk, Machine, fresh_state, phase, served, wound

from winding_core.cable.condition import Condition
from winding_core.cable.material_report import MaterialReport
from winding_core.lay.records import ControlMode
from winding_core.machine.readings import CABLE_TENSION, AxisReading
from winding_core.markers import CORRECTED_DTYPE, wound_markers
from winding_core.status import Level, Status
from winding_dashboard.drawings.cylinder_view import Sight
from winding_dashboard.page.snapshot import PERIOD, Wanted
from winding_dashboard.state.view_state import ViewState


def source(clock: Clock) -> tuple[Any, Any]:
    state = fresh_state()
    note_run(state, 20.0, ControlMode.DRIVE)
    return state, served(state, Machine(), clock=clock)


def test_snapshot_is_made_once_for_everybody_who_asks_in_its_period() -> None:
    clock = Clock()
    state, snapshots = source(clock)
    first = snapshots.snapshot(Wanted())
    note_run(state, 21.0, ControlMode.DRIVE)
    clock.now += 0.5 * PERIOD
    assert snapshots.snapshot(Wanted()) == first
    clock.now += PERIOD
    later = snapshots.snapshot(Wanted())
    assert later["sequence"] == first["sequence"] + 1
    assert later["time"] > first["time"]


def test_what_one_browser_looks_at_is_its_own() -> None:
    _, snapshots = source(Clock())
    one = snapshots.snapshot(Wanted(marker=1))
    other = snapshots.snapshot(Wanted(marker=2, sight=Sight(yaw=0.5)))
    assert one["texts"]["chart-length-title"] == "S1, mm"
    assert other["texts"]["chart-length-title"] == "S2, mm"
    parts = one["parts"].keys() | other["parts"].keys()
    assert {name for name in parts if one["parts"][name] != other["parts"][name]} == {"cylinder"}


def test_time_that_goes_back_is_reported_by_the_count_of_resets() -> None:
    clock = Clock()
    state, snapshots = source(clock)
    before = snapshots.snapshot(Wanted())
    state.clear()
    note_run(state, 1.0, ControlMode.DRIVE)
    clock.now += 2.0 * PERIOD
    after = snapshots.snapshot(Wanted())
    assert after["time"] < before["time"]
    assert after["resets"] > before["resets"]


def test_age_of_what_was_seen_is_known_for_a_while() -> None:
    clock = Clock()
    _, snapshots = source(clock)
    seen = snapshots.snapshot(Wanted())
    clock.now += 3.0
    assert snapshots.age(seen["server"], seen["sequence"]) == 3.0
    for server, sequence in (
        ("other", 1),
        (seen["server"], 99),
        (seen["server"], "1"),
        (None, None),
    ):
        assert math.isinf(snapshots.age(server, sequence))


def test_silence_of_everything_is_an_age() -> None:
    clock = Clock()
    state, snapshots = source(clock)
    assert snapshots.snapshot(Wanted())["age"] is None
    state.tick(clock.now)
    clock.now += 0.5
    assert snapshots.snapshot(Wanted())["age"] == 0.0
    clock.now += 9.0
    assert snapshots.snapshot(Wanted())["age"] == 9.5


def running() -> ViewState:
    state = fresh_state("winding")
    wound(state, Condition(case=4, duration=20.0))
    for t, angle, speed in ((0.0, 0.0, 0.0), (12.3, 20.0, 1.74)):
        state.note_axes(t, axis_reading(angle, 0.06, speed=speed, feed=0.005))
    state.note_measured(CABLE_TENSION, 12.3, 3.92)
    tracked = wound_markers(
        ids=[1], theta=np.array([6.0]), z=[0.01], radius=0.017, cylinder_angle=20.0
    )
    state.note_source("tracked", 12.3, tracked)
    corrected = np.zeros(1, CORRECTED_DTYPE)
    corrected["id"] = 1
    corrected["s"], corrected["s_low"], corrected["s_high"] = 0.1, 0.09, 0.11
    state.note_source("corrected", 12.3, corrected)
    state.note_votes({3: 0.25, 4: 0.75})
    return state


def test_numbers_of_the_run_are_shown() -> None:
    seen = Desk(running()).look()
    parts = seen["parts"]
    assert seen["texts"]["clock"] == "12.3 s"
    for text in ("1.740", "5.00", "3.92", "75%, 3: 25%"):
        assert text in parts["figures"]
    for text in ("100.00", "90.0–110.0", "102.49", "+2.49 %"):
        assert text in parts["markers"]


def test_band_says_state_condition_and_progress_and_judges_no_run_that_goes_on() -> None:
    band = Desk(running(), error_limit_pct=1.1).look()["parts"]["band"]
    for text in (
        "WINDING", "CASE 4", "cylinder 30 mm, cable 4 mm, 3.92 N", "62 %",
        "12.3 of 20 s machine time, 8 s left", "no run is over",
    ):  # fmt: skip
        assert text in band, text
    for judged in ("good", "limit", "2.49", "kept", "broken"):
        assert judged not in band.lower(), judged


def test_limit_that_an_operator_sets_holds_from_then_on() -> None:
    desk = Desk(running())
    desk.ask("/limits", limits={"error_limit_pct": 2.0})
    assert desk.look()["limits"]["error_limit_pct"] == 2.0


def concluded(state: ViewState, verdict: str, *sentences: str) -> None:
    """Let the orchestrator report how the run came out, as it does again and again."""
    values = {"verdict": verdict, "sentences": "\n".join(sentences)} if verdict else {}
    state.note_statuses(NOW, [Status(name="orchestrator: outcome", values=values)])


@pytest.mark.parametrize(
    ("verdict", "style"),
    [
        ("good", "kept"), ("not good", "broken"), ("failed", "broken"), ("incomplete", "open"),
        ("not judged", "open"), ("a word of tomorrow", "open"),
    ],
)  # fmt: skip
def test_verdict_is_the_record_of_the_run_in_its_colour(verdict: str, style: str) -> None:
    state = running()
    phase(state, "finished")
    concluded(state, verdict, "ended by the machine after 1.38 of 6.10 turns", "3 frames lost")
    band = Desk(state).look()["parts"]["band"]
    cell = f'<div class="cell {style}" data-part="verdict"><p class="word">{verdict.upper()}<'
    assert cell in band
    assert "ended by the machine after 1.38 of 6.10 turns; 3 frames lost" in band
    assert ("kept" in band) == (verdict == "good")


def test_verdict_of_a_run_that_was_dropped_does_not_come_back() -> None:
    state = running()
    phase(state, "finished")
    desk = Desk(state)
    concluded(state, "good", "completed: 7.77 of 7.77 turns")
    assert "GOOD" in desk.look()["parts"]["band"]
    desk.ask("/command/reset")
    concluded(state, "good", "completed: 7.77 of 7.77 turns")
    assert "GOOD" not in desk.look()["parts"]["band"]
    # The next run begins, and comes out as the one before.
    concluded(state, "")
    concluded(state, "good", "completed: 7.77 of 7.77 turns")
    assert "GOOD" in desk.look()["parts"]["band"]


@pytest.mark.parametrize("refusal", ["", "cable_fem: the cable cannot carry 70 N"])
def test_prepared_or_refused_condition_ends_what_was_shown_of_the_run_before(refusal: str) -> None:
    state = running()
    phase(state, "finished")
    concluded(state, "good", "completed: 3.30 of 3.30 turns")
    desk = Desk(state, Machine(refusal=refusal))
    asyncio.run(desk.served.session.learn_choice())
    desk.ask("/prepare", form={"case": 8, "law": "linear"})
    state.health.lifecycle = dict.fromkeys(NODES, "unconfigured" if refusal else "active")
    band = desk.look()["parts"]["band"]
    for old in ("GOOD", "WINDING", "CASE 4", "1.74", "3.30", "2.49"):
        assert old not in band, old
    assert ("NODES DOWN" in band) == bool(refusal)


@pytest.mark.parametrize("name", ["winding_rig", "cable_fem"])
def test_node_that_is_down_is_named_and_no_machine_winds(name: str) -> None:
    state = running()
    state.health.lifecycle[name] = "finalized"
    band = Desk(state).look()["parts"]["band"]
    assert "NODES DOWN" in band
    assert f"{name} is finalized; the cylinder turns" in band
    assert "WINDING" not in band


def test_latched_stop_goes_before_another_node_that_is_down() -> None:
    state = running()
    phase(state, "protective stop", Level.ERROR, reason="encoder jumps")
    state.health.lifecycle["cable_fem"] = "inactive"
    assert "P-STOP" in Desk(state).look()["parts"]["band"]


def test_silent_encoders_are_neither_winding_nor_ready() -> None:
    state = running()
    phase(state, "")
    for now in (0.0, 2.0):
        state.tick(now)
    band = Desk(state).look()["parts"]["band"]
    assert "the encoders are silent; last reading 1.74 rad/s" in band
    assert "WINDING" not in band
    assert "READY" not in band


def test_refused_limit_names_value_and_bound_and_changes_nothing() -> None:
    desk = Desk(running())
    answer = desk.ask("/limits", limits={"error_limit_pct": -3.0})
    assert "Error of a length, % must be positive, got -3" in answer
    assert desk.look()["limits"]["error_limit_pct"] == 4.8


def test_finished_machine_stands_after_as_much_as_was_wound() -> None:
    state = running()
    phase(state, "finished")
    for now in (0.0, 2.0):
        state.tick(now)
    parts = Desk(state).look()["parts"]
    assert '<div class="cell stopped" data-part="state"><p class="word">FINISHED<' in parts["band"]
    assert "62 %" in parts["band"]
    assert "left" not in parts["band"]
    assert parts["figures"].count("clock has ended") == 2
    for value in ("0.000", "0.00"):
        assert f'<p class="value">{value}</p>' in parts["figures"]
    assert "1.740" not in parts["figures"]


def test_stopped_run_shows_where_it_stands() -> None:
    state = running()
    phase(state, "idle")
    state.note_axes(
        13.0,
        AxisReading(cylinder_angle=20.4, angular_speed=0.0, carriage_position=0.06, feed_speed=0.0),
    )
    band = Desk(state).look()["parts"]["band"]
    assert "STOPPED" in band
    assert "stopped at 13.0 s" in band


def test_changes_are_shown() -> None:
    state = fresh_state()
    desk = Desk(state)
    assert "NO DATA" in desk.look()["parts"]["band"]
    phase(state, "emergency stop", Level.ERROR, reason="pressed")
    band = desk.look()["parts"]["band"]
    assert "E-STOP" in band
    assert "pressed" in band


def test_warnings_stand_beside_start() -> None:
    state = running()
    warning = Status(
        name="cable_fem", level=Level.WARN, message="prediction: 90 N is more than the cable bears"
    )
    state.health.note(0.0, [warning])
    desk = Desk(state, clock=lambda: 0.5)
    assert "cable_fem: prediction: 90 N is more than" in desk.look()["parts"]["alerts"]


def test_source_that_falls_silent_while_time_goes_on_is_marked_with_its_age() -> None:
    state = running()
    assert " old" not in Desk(state).look()["parts"]["markers"]
    state.note_axes(15.4, axis_reading(25.0, 0.07, speed=1.74, feed=0.005))
    parts = Desk(state).look()["parts"]
    assert "3 s old" in parts["markers"]
    assert "load cell, 3 s of machine time old" in parts["figures"]


def test_material_is_shown_with_its_half_width() -> None:
    state = fresh_state()
    desk = Desk(state)
    assert desk.look()["texts"]["material"] == "Effective modulus: no marker is measured yet"
    state.material = MaterialReport(
        law="neo_hookean",
        young=2.61e6,
        standard_error=3.0e4,
        half_width_90=5.2e4,
        markers=(1, 2),
        worst_share=0.01,
        taken_up=False,
    )
    assert desk.look()["texts"]["material"] == (
        "Effective modulus 2.610 ± 0.052 MPa (nine times in ten), neo hookean, from P1, P2; "
        "the model keeps its own"
    )


def test_topic_without_a_part_of_the_page_stands_in_a_plain_row() -> None:
    state = fresh_state()
    assert Desk(state).look()["hidden"]["others-card"]
    state.note_other("rig/humidity", 0.42)
    seen = Desk(state).look()
    assert "rig/humidity</th><td>0.42<" in seen["parts"]["others"]
    assert not seen["hidden"]["others-card"]


def test_text_from_the_graph_is_text_and_never_markup() -> None:
    state = fresh_state()
    phase(state, "<b>idle</b>", Level.WARN, reason="<script>")
    state.note_other("chatter", "<script>")
    parts = Desk(state).look()["parts"]
    assert "&lt;b&gt;idle&lt;/b&gt;" in parts["nodes"]
    for part in parts.values():
        assert "<b>" not in part
        assert "<script>" not in part


@pytest.mark.parametrize("query", ["?marker=99", "?marker=x", "?yaw=91", "?pitch=nan"])
def test_view_that_cannot_be_is_refused(query: str) -> None:
    assert Desk().request("GET", f"/snapshot{query}").status_code == 400


def test_cases_that_differ_by_weight_differ_in_their_first_letters() -> None:
    page = Desk().request("GET", "/").text
    for case, weight in ((7, "1.96"), (8, "3.92")):
        assert (
            f'<option value="{case}">{case}: {weight} N, cylinder 60, cable 2 mm</option>' in page
        )


def test_every_part_of_a_snapshot_has_its_element_on_the_page() -> None:
    desk = Desk(running())
    page, seen = desk.request("GET", "/").text, desk.look()
    named = [*seen["parts"], *seen["texts"], *seen["off"], *seen["hidden"], *seen["pressed"]]
    for name in [*named, *filter(None, seen["ask"].values())]:
        assert f'id="{name}"' in page, name
