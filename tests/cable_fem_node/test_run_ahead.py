"""A run that is wound ahead in pieces and beside a node's thread: results and interruptions."""

from __future__ import annotations

import itertools
import subprocess
import sys

import numpy as np
import pytest
from rods import CONFIG

from cable_fem_node.dynamics.state import DivergenceError, ImpossibleResultError
from cable_fem_node.ros.background import PredictionTask
from cable_fem_node.winding.prediction import PlannedRun, predict
from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.run_ahead import AbandonedError, RunAhead
from winding_core.markers import Markers, is_wound

DURATION = 8.0
PROGRAM = """
import os, threading
os.setpriority(os.PRIO_PROCESS, 0, {niceness})
from cable_fem_node.ros.background import BackgroundTask
task = BackgroundTask(lambda wanted: os.getpriority(os.PRIO_PROCESS, threading.get_native_id()))
print(task.result())
"""
RUN = PlannedRun(config=CONFIG, duration=DURATION)


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
    run = ahead(2.0)
    task = PredictionTask(run, 1.5)
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
    program = [sys.executable, "-c", PROGRAM.format(niceness=niceness)]
    done = subprocess.run(program, capture_output=True, text=True, check=True)
    assert int(done.stdout) == expected
