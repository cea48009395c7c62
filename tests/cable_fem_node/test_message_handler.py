"""What the solver's handler answers: predictions in pieces, the cable's end, a replayed run."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rods import CONFIG, DRIVE
from solver_bench import SolverBench, fed

from cable_fem_node.ros import message_handler
from cable_fem_node.ros.message_handler import FemHandler
from cable_fem_node.ros.parameters import FemParameters
from cable_fem_node.winding.prediction import predict
from cable_fem_node.winding.run_ahead import PIECE
from cable_fem_node.winding.solid_winding import SolidWinding
from winding_core.lay.guide_path import lay_of, layer_lag
from winding_core.lay.layers import FULL_TURN
from winding_core.machine.incoming_readings import LEAD_IN, has_moved
from winding_core.machine.readings import AxisReading
from winding_core.markers import CABLE_DTYPE, MARKER_DTYPE, Markers, is_wound, wound_markers
from winding_core.run_inputs import RunInputs, no_inputs
from winding_ros import topics
from winding_ros.messages.clouds import decode_cloud
from winding_ros.messages.stamps import decode_stamp, encode_stamp

LONG = PIECE + 4.0
DURATION = 0.6
CUT = 400
# Coarse and heavy, so that the tests are quick: both sides of a comparison wind the same solid.
SOLID: dict[str, Any] = {"element": "solid", "segment_length": 0.02, "mass_scaling": 2000.0}


def predicted(answers: Any) -> list[tuple[float, Markers]]:
    return [decode_cloud(answer.data, MARKER_DTYPE) for answer in answers]


@pytest.mark.slow
def test_run_is_predicted_in_pieces_and_ends_as_the_whole() -> None:
    handler = FemHandler(FemParameters(case=4, duration=LONG), ahead_elsewhere=True)
    # What configuring waits for is the first piece, however long the run is.
    assert handler.ahead.model.time == pytest.approx(PIECE, abs=0.02)
    assert not handler.ahead.done
    ((t, first),) = predicted(handler.begin(7.0))
    assert t == 7.0
    assert is_wound(first).all()
    list(handler.ahead.wind_on())
    (_, early), (_, last) = predicted(handler.begin(8.0))
    np.testing.assert_array_equal(early, first)
    whole = predict(CONFIG, duration=LONG).markers
    for name in ("theta", "z", "s", "flags"):
        np.testing.assert_array_equal(last[name], whole[name])


@pytest.mark.slow
def test_handler_that_is_alone_yields_the_whole_prediction_at_once() -> None:
    handler = FemHandler(FemParameters(case=4, duration=LONG))
    assert len(predicted(handler.begin(0.0))) == 2
    assert handler.ahead.done


def test_run_of_an_hour_is_configured_after_its_first_piece() -> None:
    handler = FemHandler(FemParameters(case=4, duration=3600.0), ahead_elsewhere=True)
    assert handler.ahead.model.time <= PIECE + 0.02


def test_stiff_cable_is_configured_after_part_of_a_piece(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(message_handler, "FIRST_STEPS", 1.0e5)
    handler = FemHandler(FemParameters(case=4, duration=LONG), ahead_elsewhere=True)
    assert 0.0 < handler.ahead.model.time < 1.0
    assert predicted(handler.begin(0.0)) == []


@pytest.mark.slow
def test_node_publishes_the_rest_of_a_prediction_by_itself(ros: Any) -> None:
    bench = SolverBench(ros, duration=LONG)
    bench.wait_for(topics.FEM_PREDICTION, 2)
    (t, first), (t2, last) = bench.markers(topics.FEM_PREDICTION)
    # Both are made from what was known when the run began.
    assert t == t2
    np.testing.assert_allclose(first["s"], last["s"], rtol=0.0, atol=1.0e-5)
    assert bench.node.status().values["predicted_to"] == f"{LONG:.1f}"
    bench.begin_anew()
    # A new run, the same plan: nothing is wound again.
    bench.wait_for(topics.FEM_PREDICTION, 4)


@pytest.mark.slow
def test_solid_follows_as_it_does_alone_beside_the_rod_s_prediction() -> None:
    wanted = FemParameters(case=4, duration=DURATION, follow_tension=False, **SOLID)
    handler = FemHandler(wanted, ahead_elsewhere=True)
    ((_, ahead),) = predicted(handler.begin(0.0))
    np.testing.assert_array_equal(ahead["s"], predict(CONFIG, duration=DURATION).markers["s"])
    rows = message_pairs()
    stamp, live = fed(handler, rows)[-1]
    run = wanted.in_step()
    alone = SolidWinding(run.config, run.most_wound)
    for t, reading, _ in rows:
        if t <= stamp:
            alone.advance_to(t - rows[0][0], reading)
    # Stamps are whole nanoseconds, of which both take differences.
    np.testing.assert_allclose(live["theta"], alone.markers()["theta"], rtol=1e-9)
    whole, cable = handler.model.cable(), handler.model.newest_cable(12.0)
    # It ends with the last section before the guide; behind hangs the cable of the rest of the run.
    assert cable["y"].min() >= -CONFIG.free_length > whole["y"][cable.size]
    list(handler.begin(0.0))
    assert handler.model.time == 0.0


@pytest.mark.parametrize(
    ("wanted", "sentence"),
    [
        ({"prony": "0.2:1.5"}, "knows elastic cables alone"),
        ({"bending_factor": 2.0}, "bending_factor must be 1, got 2"),
        ({"law": "hencky_cauchy"}, "take law hencky"),
        ({"take_up_material": True}, "take element rod instead of solid"),
    ],
)
def test_what_the_solid_cannot_do_is_refused(wanted: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        FemHandler(FemParameters(case=4, element="solid", **wanted))


def test_standstill_that_was_held_back_is_wound_and_not_published() -> None:
    wanted = FemParameters(case=4, duration=0.5, follow_tension=False, await_motion=True)
    handler = FemHandler(wanted, ahead_elsewhere=True)
    list(handler.begin(0.0))
    standing, rate = 1.7, 500.0
    times = (np.arange(0, round(2.5 * rate)) / rate).tolist()
    rows = [(t, DRIVE.reading_at(max(t - standing, 0.0)), None) for t in times]
    stamps = [t for t, _ in fed(handler, rows, topics.FEM_MARKERS, MARKER_DTYPE)]
    moving = next(t for t, reading, _ in rows if has_moved(reading))
    # A period passes until the first one is due.
    assert moving - 1e-6 <= stamps[0] <= moving + 0.02
    assert np.diff(stamps) == pytest.approx(0.02, abs=0.0021)
    assert handler.model.time == pytest.approx(times[-1] - (moving - LEAD_IN), abs=1e-6)


def merged(known: np.ndarray, news: np.ndarray) -> np.ndarray:
    """Return the cable as docs/interfaces.md has it: old turns have turned with the cylinder."""
    old = known[known["s"] < news["s"][0]].copy()
    if old.size:
        (same,) = known[known["s"] == news["s"][0]]
        apart = np.arctan2(news["y"][0], news["x"][0]) - np.arctan2(same["y"], same["x"])
        c, s = np.cos(apart), np.sin(apart)
        old["x"], old["y"] = c * old["x"] - s * old["y"], s * old["x"] + c * old["y"]
    return np.concatenate([old, news])


def test_messages_of_newest_turns_make_up_the_whole_cable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(message_handler, "_CABLE_TURNS", 0.5)
    handler = FemHandler(
        FemParameters(case=4, duration=0.5, follow_tension=False), ahead_elsewhere=True
    )
    list(handler.begin(0.0))
    known, sizes = np.zeros(0, dtype=CABLE_DTYPE), []
    times = (0.01 * np.arange(1501)).tolist()
    rows = [(t, DRIVE.reading_at(t), None) for t in times]
    for _, news in fed(handler, rows, topics.FEM_CABLE, CABLE_DTYPE):
        sizes.append(news.size)
        known = merged(known, news)
    whole = handler.model.cable()
    # The free span, what stays awake, and half a turn; a fifth more rests from time to time.
    assert max(sizes[200:]) < whole.size - 20
    assert known.size == whole.size
    np.testing.assert_array_equal(known["s"], whole["s"])
    np.testing.assert_allclose(known["tension"], whole["tension"], rtol=1.0e-3)
    for name in "xyz":
        # Single precision, turned three hundred times.
        np.testing.assert_allclose(known[name], whole[name], rtol=0.0, atol=1.0e-6)


def message_pairs() -> list[tuple[float, AxisReading, float | None]]:
    rows = []
    for k in range(600):
        # As in a stamp: in whole nanoseconds.
        t = decode_stamp(encode_stamp(2.0 + 1.0e-3 * k))
        tension = 3.9 + 0.01 * (k // 10 % 7) if k % 10 == 0 else None
        rows.append((t, DRIVE.reading_at(t - 2.0), tension))
    return rows


def begun(**parameters: Any) -> FemHandler:
    handler = FemHandler(FemParameters(duration=DURATION, **parameters))
    list(handler.begin(0.0))
    return handler


def written(file: Path) -> Path:
    samples = no_inputs(CUT)
    newest = np.nan
    for k, (t, reading, tension) in enumerate(message_pairs()[:CUT]):
        newest = newest if tension is None else tension
        motion = (reading.cylinder_angle, reading.angular_speed)
        guide = (reading.carriage_position, reading.feed_speed)
        samples[k] = (t, *motion, *guide, newest, np.nan, np.nan)
    RunInputs(samples=samples).write(file)
    return file


def test_successor_answers_as_its_predecessor_would_have(tmp_path: Path) -> None:
    rows = message_pairs()
    unbroken = begun()
    fed(unbroken, rows[:CUT])
    wanted = fed(unbroken, rows[CUT:])
    successor = begun(replay=str(written(tmp_path / "inputs.npy")))
    assert successor.replayed is not None
    assert abs(successor.replayed - (CUT - 1) * 1.0e-3) < 1e-9
    got = fed(successor, rows[CUT:])
    assert len(wanted) == 10
    assert [t for t, _ in got] == [t for t, _ in wanted]
    for (_, one), (_, other) in zip(got, wanted, strict=True):
        np.testing.assert_array_equal(one, other)


def test_run_after_a_replayed_one_begins_at_its_own_start(tmp_path: Path) -> None:
    successor = begun(replay=str(written(tmp_path / "inputs.npy")))
    list(successor.begin(0.0))
    assert successor.model.time == 0.0
    assert not successor.following


# Two turns a layer of a cable of 4 mm, wound in seconds.
DRUM: dict[str, Any] = {"case": 9, "drum_width": 0.009, "flange": 0.02, "layers": 2}


def filled_drum(**changes: Any) -> FemParameters:
    wanted = FemParameters(**{**DRUM, **changes})
    what = wanted.resolved()
    end = float(wanted.wind(what.case, wanted.pitch or None).theta[-1])
    # Just before the drum is full.
    return replace(wanted, duration=what.drive.time_at_angle(end) - 0.01)


@pytest.mark.slow
def test_filled_drum_is_wound_ahead_in_layers_between_its_flanges() -> None:
    wanted = filled_drum()
    handler = FemHandler(wanted)
    list(handler.ahead.wind_on())
    model = handler.ahead.model
    _, theta, z = model.wound_path()
    cable = model.cable()[: theta.size]
    d, first = handler.config.case.cable_diameter, handler.config.case.centreline_radius
    raised = np.hypot(cable["x"], cable["y"]) - first
    # Springs of flanges give way by less than a twentieth of a diameter.
    assert z.min() > -0.05 * d
    assert z.max() < DRUM["drum_width"] - d + 0.05 * d
    # Cable on cable lies at most a diameter higher, and in no valley lower than one of 1.7 d.
    upper = raised[theta > wanted.wind(handler.config.case, None).theta[-1] - 3.0]
    assert 0.5 * d < np.median(upper) < 1.05 * d
    # No cable lies on the first turn.
    assert raised[theta < 6.0].max() < 0.05 * d
    assert model.energy.balance_pct < 1.0


def test_guide_of_a_filled_drum_begins_at_p0_and_lays_its_program() -> None:
    wanted = filled_drum(winding="parallel", drum_width=0.03)
    what = wanted.resolved()
    wound = wanted.wind(what.case, None)
    drive = wanted.ahead().drive
    theta, guide = (np.asarray(part) for part in drive.positions(np.linspace(0.0, 30.0, 30_001)))
    assert guide[0] == pytest.approx(0.0, abs=1.0e-9)
    lag = layer_lag(
        what.free_length / what.case.centreline_radius,
        what.case.centreline_radius,
        wound.program().raised_at(theta[1:]),
    )
    z = lay_of(theta, guide, lag)
    # What is missing of the first turn decays with the lag of about a turn; corners are rounded.
    late = (theta > 2.5 * FULL_TURN) & (theta < wound.theta[-1])
    missed = np.abs(z - np.interp(theta, wound.theta, wound.z))[late]
    assert missed.max() < 0.5 * what.case.cable_diameter
    assert np.median(missed) < 0.1 * what.case.cable_diameter


def test_marker_on_a_second_layer_stands_out_from_the_first() -> None:
    markers = wound_markers(
        ids=[0, 1],
        theta=[0.0, 1.0],
        z=[0.0, 0.0],
        radius=0.03,
        cylinder_angle=0.0,
        raised=[0, 4e-3],
    )
    np.testing.assert_allclose(np.hypot(markers["x"], markers["y"]), [0.03, 0.034], rtol=1e-6)
    assert markers["s"][1] == pytest.approx(0.03)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"element": "solid"}, "the solid element lies on a bare cylinder: leave out the drum"),
        ({"layers": 9}, "9 layers would pass the flanges"),
        ({"flange": 0.0}, "flange is missing"),
    ],
)
def test_drum_that_cannot_be_wound_live_is_refused(changes: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        FemParameters(**{**DRUM, **changes}).in_step()


def test_run_whose_drive_programme_leaves_the_drum_is_predicted_on_a_bare_cylinder() -> None:
    # Another lay is wanted then, which stays on it; the model in step has the flanges.
    wanted = FemParameters(case=4, drum_width=0.03, flange=0.02)
    assert wanted.ahead().config.drum is None
    assert wanted.in_step().config.drum is not None
    assert FemParameters(case=4, drum_width=0.2, flange=0.02).ahead().config.drum is not None
