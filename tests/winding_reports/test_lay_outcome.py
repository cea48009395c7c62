"""What became of a wanted lay, from closed and open loops in one process, and in the report."""

import dataclasses
import json
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from lay_control_node.ros.parameters import LayControlParameters
from winding_core.lay.records import LAY_CONTROL_DTYPE, LAY_DTYPE, ControlBasis, ControlMode
from winding_reports.records.lay_outcome import (
    LaidLine,
    LaidRun,
    LayOutcome,
    lay_outcome,
    outcome_json,
)
from winding_reports.records.run_record import run_json
from winding_reports.run_report.report import render_report
from winding_rig_node.lay.lay_on import HiddenRig
from winding_verification.closed_loop.run import ClosedResult, ClosedRun, wind

TURNS = 4.0
WANTED = LayControlParameters(case=4, law="neo_hookean")
WHAT = WANTED.resolved()
NOTHING = LaidLine(theta=np.zeros(0), z=np.zeros(0))


def laid(mode: ControlMode) -> ClosedResult:
    return wind(
        ClosedRun(
            what=WHAT,
            wanted=WANTED.new_controller().wanted,
            end=TURNS * math.tau,
            truth="driven",
            hidden=HiddenRig.drawn(np.random.default_rng(1)),
            mode=mode,
        )
    )


def left_by(result: ClosedResult, mode: ControlMode) -> LaidRun:
    """Return the records of a run whose lay is measured without an error."""
    control = np.zeros(len(result.setpoints), LAY_CONTROL_DTYPE)
    for record, setpoint in zip(control, result.setpoints, strict=True):
        record["theta"], record["wanted_z"] = setpoint.theta, setpoint.wanted_z
        record["free_length"] = setpoint.lay.free_length
        record["sigma_free_length"] = setpoint.lay.sigma_length
        record["load_share"], record["mode"] = setpoint.stretch.share, mode
    places = np.zeros(result.theta.size, LAY_DTYPE)
    places["theta"], places["z"] = result.theta, result.z
    return LaidRun(
        control=control, places=places, predicted=NOTHING, ahead=NOTHING, landed={1: 6.3}
    )


@pytest.fixture(scope="module")
def driven() -> LayOutcome:
    run = left_by(laid(ControlMode.DRIVE), ControlMode.DRIVE)
    return lay_outcome(run, WHAT, tolerance=0.5e-3, markers={1: math.tau, 2: 2.0 * math.tau})


@pytest.fixture(scope="module")
def watched() -> LayOutcome:
    run = left_by(laid(ControlMode.WATCH), ControlMode.WATCH)
    return lay_outcome(run, WHAT, tolerance=0.5e-3, markers={})


@pytest.mark.slow
def test_the_estimate_without_control_is_what_is_laid_without(watched: LayOutcome) -> None:
    assert watched.turns
    without = {turn.number: turn.mean for turn in watched.without_turns}
    for turn in watched.turns:
        # The law leaves out what the hidden rig has beside the lag: 0.3 mm of play of the eye,
        # and a bending length of 3 mm, which is one of 196 mm of the lag. The lag is 35 mm.
        assert without[turn.number] == pytest.approx(turn.mean, abs=0.3e-3 + 35.0e-3 * 3.0 / 196.0)


@pytest.mark.slow
def test_driven_lay_is_judged_and_open_loop_shown(driven: LayOutcome, watched: LayOutcome) -> None:
    assert driven.verdict.kept is True
    assert driven.drove
    assert watched.verdict.kept is False
    assert not watched.drove
    achieved, without = driven.rms()
    # The estimated free length of both runs, which wound under one hidden rig, is nearly equal.
    assert without == pytest.approx(watched.rms()[1], rel=0.02)
    assert achieved < 0.01 * without


def test_estimates_and_bases_are_those_of_the_run(driven: LayOutcome) -> None:
    assert driven.sigma_free_length < 0.02
    shares = {basis: float(basis is ControlBasis.MEASURED) for basis in ControlBasis}
    assert driven.basis_shares == shares


def test_solver_s_forecast_is_shown_where_the_drive_programme_was_wanted() -> None:
    advance = WHAT.drive.advance_per_radian
    control = np.zeros(200, LAY_CONTROL_DTYPE)
    control["theta"] = np.linspace(0.0, 20.0, 200)
    control["free_length"] = 0.198
    ahead = LaidLine(theta=np.array([6.3, 12.6]), z=np.array([4.5e-3, 15.3e-3]))
    for factor, shown in ((1.0, 2), (0.7, 0)):
        control["wanted_z"] = factor * advance * control["theta"]
        places = np.zeros(0, LAY_DTYPE)
        run = LaidRun(control=control, places=places, predicted=NOTHING, ahead=ahead, landed={})
        outcome = lay_outcome(run, WHAT, tolerance=0.5e-3, markers={})
        assert outcome.ahead.theta.size == shown
        assert outcome.turns == ()
        assert outcome.verdict.kept is None


def test_numbers_are_json_and_the_run_s_verdict_is_a_driven_lay_s(
    driven: LayOutcome, watched: LayOutcome, synthetic: Callable[..., Any]
) -> None:
    record = dataclasses.replace(synthetic(), lay=driven)
    read = json.loads(json.dumps(run_json(record), allow_nan=False))
    assert read["verdict"] == {"kept": True, "sentence": driven.verdict.sentence}
    assert [turn["turn"] for turn in read["lay"]["turns"]] == [1, 2, 3, 4]
    assert [turn["judged"] for turn in read["lay"]["turns"]] == [False, False, True, True]
    first, second = read["lay"]["markers"]
    assert first["error_rad"] == pytest.approx(6.3 - math.tau)
    assert second["landed_rad"] is None
    assert read["lay"]["free_length_m"] == driven.free_length
    open_loop = run_json(dataclasses.replace(synthetic(), lay=watched))
    assert "verdict" not in open_loop
    assert open_loop["lay"]["kept"] is False
    assert "lay" not in run_json(synthetic())


@pytest.mark.slow
def test_report_shows_the_lay_of_a_controlled_run(driven: LayOutcome, synthetic: Any) -> None:
    page = render_report(dataclasses.replace(synthetic(), lay=driven))
    for text in (
        ">Lay</h2>",
        "The lay keeps 0.5 mm in turns 3 and 4",
        "Mean error without control, mm",
        "The lay that was wanted and the lay that was made",
        "Every turn of the lay",
        "drive: it commanded the machine",
    ):
        assert text in page


def test_lay_of_which_nothing_was_measured_still_has_its_figures(driven: LayOutcome) -> None:
    nothing = dataclasses.replace(driven, turns=(), measured=np.zeros(0, LAY_DTYPE))
    figures = outcome_json(nothing)
    assert figures["turns"] == []
    assert figures["rms_m"] is None
