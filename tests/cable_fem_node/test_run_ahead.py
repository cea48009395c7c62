"""A run that is wound ahead in pieces: what it finds, and what interrupts it."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from cable_fem_node.dynamics.failure import DivergenceError, ImpossibleResultError
from cable_fem_node.ros.background import PredictionTask
from cable_fem_node.winding.prediction import PlannedRun, predict
from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.run_ahead import AbandonedError, RunAhead
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.cases import paper_case
from winding_core.markers import Markers, is_wound

CONFIG = WindingConfig(case=paper_case(4))
DURATION = 8.0
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
    told = list(run.wind_on())
    assert run.done
    assert len(told) == len(run.found)
    np.testing.assert_array_equal(told[-1], whole)


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


def test_task_tells_every_piece_in_order(whole: Markers) -> None:
    run = ahead(2.0)
    task = PredictionTask(run, 1.5)
    told: list[Markers] = []
    # The run says that it is done before its last piece is found.
    while not task.failure and (not told or is_wound(told[-1]).sum() < is_wound(whole).sum()):
        told += task.news()
    task.abandon()
    assert [int(is_wound(markers).sum()) for markers in told] == [2, 3]
    np.testing.assert_array_equal(told[-1], whole)
    assert (task.begun, task.reached, task.failure) == (1.5, DURATION, "")


def test_task_says_why_it_ended_before_the_run() -> None:
    def diverge(_model: RodWinding) -> None:
        raise DivergenceError("the winding diverged")

    still = RUN.drive.reading_at(0.0)
    run = RunAhead(RodWinding(CONFIG), [(0.01, still, None), (0.02, still, None)], diverge)
    task = PredictionTask(run, 0.0)
    while not task.failure:
        assert list(task.news()) == []
    assert task.failure == "ended at t = 0.02 s: the winding diverged"
