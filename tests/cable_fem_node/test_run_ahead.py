"""A run that is wound ahead in pieces, beside a node's thread, or again from its thinned inputs."""

import itertools
import sys

import numpy as np
import pytest
from rods import CASE, CONFIG, DRIVE, follow

from cable_fem_node.dynamics.state import DivergenceError, ImpossibleResultError
from cable_fem_node.ros.background import PredictionTask
from cable_fem_node.winding.prediction import PlannedRun, predict
from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.run_ahead import AbandonedError, RunAhead, replay
from cable_fem_node.winding.winding_config import WindingConfig
from processes import python
from winding_core.markers import Markers, is_wound
from winding_core.run_inputs import RunHistory, continued_inputs, planned_inputs

DURATION = 8.0
PROGRAM = """
import os, threading
os.setpriority(os.PRIO_PROCESS, 0, {niceness})
from cable_fem_node.ros.background import BackgroundTask
task = BackgroundTask(lambda wanted: os.getpriority(os.PRIO_PROCESS, threading.get_native_id()))
print(task.result())
"""
RUN = PlannedRun(config=CONFIG, duration=DURATION)
# Coarse, so that the tests are quick: both sides of a comparison wind the same rod.
COARSE = WindingConfig(case=CASE, segment_length=0.009)


@pytest.fixture(scope="module")
def whole() -> Markers:
    return predict(CONFIG, duration=DURATION).markers


def ahead(piece: float) -> RunAhead:
    return RunAhead.of(RUN, piece=piece)


# 8 s in one piece, in pieces that end with the run, and in pieces that do not.
@pytest.mark.parametrize("piece", [20.0, 8.0, 4.0, 3.0])
def test_pieces_end_where_the_whole_run_does(whole: Markers, piece: float) -> None:
    run = ahead(piece)
    found = list(run.wind_on())
    assert run.done
    assert len(found) == len(run.found)
    np.testing.assert_array_equal(found[-1], whole)


def test_the_end_alone_is_the_last_record_of_the_whole_history(whole: Markers) -> None:
    end = RUN.wind(whole=False)
    assert end.history.shape == (1, whole.size)
    np.testing.assert_array_equal(end.markers, whole)
    assert end.duration == DURATION


def test_what_a_piece_finds_of_a_landed_marker_stays(whole: Markers) -> None:
    found = list(ahead(2.0).wind_on())
    counts = [int(is_wound(markers).sum()) for markers in found]
    # P1 lands at 4.3 s and P2 at 7.9 s, so the pieces to 2 s and 4 s have nothing to tell.
    assert counts == [2, 3]
    early, late = found[0][:2], whole[:2]
    # Two turns deep nothing moves by more than resting may change, see test_resting_cable.
    np.testing.assert_allclose(early["theta"], late["theta"], rtol=0.0, atol=1.0e-4)
    np.testing.assert_allclose(early["z"], late["z"], rtol=0.0, atol=2.0e-5)


def test_a_first_piece_that_is_cut_short_changes_nothing(whole: Markers) -> None:
    run = ahead(20.0)
    assert run.wind_piece(most_steps=1.0e5) is None
    assert 0.0 < run.model.time < DURATION
    list(run.wind_on())
    np.testing.assert_array_equal(run.found[-1], whole)


def test_what_was_given_up_goes_on_from_there(whole: Markers) -> None:
    run = ahead(20.0)
    asked = itertools.count(1)
    with pytest.raises(AbandonedError, match="given up at t = "):
        run.wind_piece(lambda: next(asked) <= 100)
    reached = run.model.time
    list(run.wind_on())
    assert 0.0 < reached < DURATION
    np.testing.assert_array_equal(run.found[-1], whole)


def test_every_piece_is_checked(monkeypatch: pytest.MonkeyPatch) -> None:
    times = []

    def refuse(_run: PlannedRun, _theta: object, _tension: object, t: float) -> None:
        times.append(t)
        if t > 4.0:
            raise ImpossibleResultError("the cable does not follow")

    monkeypatch.setattr(PlannedRun, "refuse_impossible", refuse)
    with pytest.raises(ImpossibleResultError, match="does not follow"):
        list(ahead(2.0).wind_on())
    np.testing.assert_allclose(times, [2.0, 4.0, 6.0])


@pytest.mark.slow
def test_task_yields_every_piece_in_order(whole: Markers) -> None:
    task = PredictionTask(ahead(2.0), 1.5)
    news: list[Markers] = []
    # The run is done before its last piece is found.
    while not task.failure and (not news or is_wound(news[-1]).sum() < is_wound(whole).sum()):
        news += task.news()
    task.abandon()
    assert [int(is_wound(markers).sum()) for markers in news] == [2, 3]
    np.testing.assert_array_equal(news[-1], whole)
    assert (task.begun, task.reached, task.failure) == (1.5, DURATION, "")


def test_task_reports_why_it_ended_before_the_run() -> None:
    def diverge(_model: RodWinding) -> None:
        raise DivergenceError("the winding diverged")

    still = RUN.drive.reading_at(0.0)
    run = RunAhead(RodWinding(CONFIG), [(0.01, still, None), (0.02, still, None)], diverge)
    task = PredictionTask(run, 0.0)
    while not task.failure:
        assert list(task.news()) == []
    assert task.failure == "ended at t = 0.02 s: the winding diverged"


@pytest.mark.skipif(sys.platform != "linux", reason="a niceness per thread is Linux's")
@pytest.mark.parametrize(("niceness", "expected"), [(10, 15), (17, 19)])
def test_a_nice_process_has_nicer_tasks(niceness: int, expected: int) -> None:
    # A process of an ordinary user may raise a niceness and never lower it.
    assert int(python(PROGRAM.format(niceness=niceness), check=True).stdout) == expected


def recorded(duration: float, **how: float) -> RunHistory:
    history = RunHistory(**how)  # type: ignore[arg-type]
    for sample in range(round(duration * 1000) + 1):
        history.record(sample * 1e-3, DRIVE.reading_at(sample * 1e-3), CASE.weight)
    return history


def test_replay_lays_the_cable_where_every_sample_laid_it() -> None:
    live = follow(RodWinding(COARSE), 3.0, 1e-3, CASE.weight)
    again = RodWinding(COARSE)
    replay(recorded(3.0).inputs, again)
    assert again.time == pytest.approx(3.0, abs=1e-9)
    s = np.linspace(0.0, 0.06, 7)
    paths = [
        [np.interp(s, model.wound_path()[0], column) for column in model.wound_path()[1:]]
        for model in (live, again)
    ]
    # A tenth of what the tracker resolves: 0.1 mrad and 0.01 mm.
    np.testing.assert_allclose(paths[0][0], paths[1][0], atol=1e-4)
    np.testing.assert_allclose(paths[0][1], paths[1][1], atol=1e-5)


def test_full_history_thins_itself_and_keeps_beginning_and_end() -> None:
    history = recorded(10.0, period=0.02, capacity=64)
    assert len(history) <= 64
    assert history.inputs["t"][0] == 0.0
    assert 10.0 - history.duration <= history.period
    # Every 20 ms would be 501 samples: a period three times doubled gives 63.
    assert history.period == pytest.approx(0.16)


def test_thinned_motion_is_that_of_the_machine() -> None:
    inputs = recorded(10.0, period=0.02, capacity=64).inputs
    angle, guide = DRIVE.positions(inputs["t"])
    np.testing.assert_allclose(inputs["cylinder_angle"], angle, atol=1e-12)
    np.testing.assert_allclose(inputs["carriage_position"], guide, atol=1e-12)


def test_kept_tension_is_the_mean_since_the_sample_before() -> None:
    rng = np.random.default_rng(0)
    history = RunHistory(period=0.02, capacity=64)
    for sample in range(10001):
        history.record(
            sample * 1e-3, DRIVE.reading_at(sample * 1e-3), 3.0 + 0.1 * rng.standard_normal()
        )
    tensions = history.inputs["tension"][1:]
    # 160 readings stand behind most: 0.1 / sqrt(160) = 0.008; single readings would spread by 0.1.
    assert tensions.std() < 0.02
    assert tensions.mean() == pytest.approx(3.0, abs=0.004)


def test_missing_tension_leaves_the_model_to_its_own_law() -> None:
    history = RunHistory()
    history.record(0.0, DRIVE.reading_at(0.0), None)
    history.record(1.0, DRIVE.reading_at(1.0), None)
    model = RodWinding(COARSE)
    replay(history.inputs, model)
    assert model.span_tension == CASE.weight


def test_time_that_does_not_ascend_is_refused() -> None:
    history = recorded(0.1)
    with pytest.raises(ValueError, match=r"must ascend: after 0\.1 s came 0\.1 s"):
        history.record(0.1, DRIVE.reading_at(0.1), None)


@pytest.mark.parametrize(("name", "value"), [("period", 0.0), ("capacity", 3)])
def test_senseless_size_is_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"{name} must be"):
        RunHistory(**{name: value})  # type: ignore[arg-type]


def test_replay_ends_when_it_is_not_wanted() -> None:
    model = RodWinding(COARSE)
    with pytest.raises(AbandonedError):
        replay(planned_inputs(DRIVE, 5.0), model, going=lambda: model.time < 1.0)
    assert model.time == pytest.approx(1.0, abs=0.021)


def test_continued_run_goes_on_at_top_speed() -> None:
    inputs = continued_inputs(planned_inputs(DRIVE, 5.0, tension=2.0), 12.0)
    angle, guide = DRIVE.positions(inputs["t"])
    np.testing.assert_allclose(inputs["cylinder_angle"], angle, atol=1e-9)
    np.testing.assert_allclose(inputs["carriage_position"], guide, atol=1e-12)
    assert inputs["cylinder_angle"][-1] >= 12.0
    assert (inputs["tension"] == 2.0).all()
