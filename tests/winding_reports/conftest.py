import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from winding_core.cable.cases import Case, paper_case, published_markers
from winding_core.error_verdict import PAPER_LIMIT_PCT
from winding_core.helix import PAPER_FREE_LENGTH, FleetAngleLaw, curve_length
from winding_core.machine.drive import DriveProfile
from winding_core.markers import MARKER_DTYPE
from winding_core.run_outcome import Ending, Extent, RunOutcome
from winding_reports.records.run_record import (
    MarkerRow,
    MarkerSeries,
    RunRecord,
    Signal,
    judge_lengths,
)

sys.path.insert(0, str(Path(__file__).parent))


def _series(case, drive, marks, *, rate, rng, noise=0.0, in_view_only=False) -> MarkerSeries:
    stamps, records = [np.empty(0)], [np.zeros(0, dtype=MARKER_DTYPE)]
    for marker, (theta, z) in marks.items():
        landed = drive.time_at_angle(theta)
        t = np.arange(np.ceil(landed * rate), 20.0 * rate) / rate
        if in_view_only:
            t = t[np.cos(drive.positions(t)[0] - theta) > 0.5]
        seen = np.zeros(t.size, dtype=MARKER_DTYPE)
        seen["id"], seen["sigma_theta"], seen["sigma_z"] = marker, noise, 0.02 * noise
        seen["theta"] = theta + noise * rng.normal(size=t.size)
        seen["z"] = z + 0.02 * noise * rng.normal(size=t.size)
        seen["s"] = curve_length(case.centreline_radius, seen["theta"], seen["z"])
        stamps.append(t)
        records.append(seen)
    return MarkerSeries.of_records(np.concatenate(stamps), np.concatenate(records))


def _synthetic(case: Case | None = None, h: float = 0.957) -> RunRecord:
    """A run as a machine might leave it: made of the drive's closed form and numpy's noise."""
    case = case or paper_case(4)
    drive = DriveProfile()
    rng = np.random.default_rng(0)
    t = np.arange(1, 20001) / 1000.0
    slow = np.arange(1, 1001) / 50.0
    share, target = drive.fraction(t), drive.fraction(slow)
    swing = 1.0 + 0.012 * np.exp(-((t - 1.0) ** 2) / 0.05) + 0.004 * rng.normal(size=t.size)
    stretch = 1.0 + case.nominal_stress / case.material.young
    law = FleetAngleLaw(
        advance_per_radian=drive.advance_per_radian,
        free_length=PAPER_FREE_LENGTH,
        radius=case.centreline_radius,
    )
    reach = drive.positions(20.0)[0]
    predicted = {
        n: (stretch * case.original_length(n) / case.centreline_radius * 0.994)
        for n in range(1, case.marker_count + 1)
    }
    predicted = {n: (theta, float(law.z(theta))) for n, theta in predicted.items() if theta < reach}
    measured = {
        row.marker: (row.experiment.theta, row.experiment.z)
        for row in (published_markers(case.number) if case.number else ())
        if row.experiment
    } or {n: (0.98 * theta, z + 4e-4) for n, (theta, z) in predicted.items()}
    published = {
        row.marker: row.experiment.s
        for row in (published_markers(case.number) if case.number else ())
        if row.experiment
    }
    rows = []
    for n in range(1, case.marker_count + 1):
        s_fem = curve_length(case.centreline_radius, *predicted[n]) if n in predicted else None
        seen = curve_length(case.centreline_radius, *measured[n]) if n in measured else None
        rows.append(
            MarkerRow(
                id=n,
                original=case.original_length(n),
                s_fem=s_fem,
                s_tracked=seen,
                h=h if s_fem else None,
                s_corrected=h * s_fem if s_fem else None,
                s_low=0.81 * h * s_fem if s_fem else None,
                s_high=1.19 * h * s_fem if s_fem else None,
                s_published=published.get(n),
            )
        )
    return RunRecord(
        case=case,
        drive=drive,
        cylinder_speed=Signal(t=t, value=drive.angular_speed * share * swing),
        carriage_speed=Signal(t=t, value=drive.feed_speed * share * swing[::-1]),
        cylinder_setpoint=Signal(t=slow, value=drive.angular_speed * target),
        carriage_setpoint=Signal(t=slow, value=drive.feed_speed * target),
        tension=Signal(t=t[::10], value=case.weight + 0.01 * rng.normal(size=t[::10].size)),
        predicted=_series(case, drive, predicted, rate=50.0, rng=rng),
        tracked=_series(case, drive, measured, rate=200.0, noise=5e-4, rng=rng, in_view_only=True),
        corrected=_series(case, drive, predicted, rate=50.0, rng=rng),
        rows=tuple(rows),
        outcome=RunOutcome(
            asked=Extent(turns=5.54, time=20.0, markers=len(predicted)),
            done=Extent(turns=5.54, time=20.0, markers=len(predicted)),
            ending=Ending(),
            lengths=judge_lengths(rows, PAPER_LIMIT_PCT, published=case.is_published),
        ),
        frames=4000,
        frames_lost=0,
        joint_states=20000,
        joint_states_lost=0,
        wall_s=21.4,
        sim_s=20.0,
        facts={"Lay": "paper: the published measurement", "Trained weight": "rod, seed 0"},
        notes=(
            "h was learned from all twelve cases, this one included: its corrected error is "
            "in-sample. With each case left out the network's mean error is 4.46 %.",
            "The rig lays the markers where the paper's experiment found them, so tracked minus "
            "published is the error of camera and tracker alone.",
        ),
    )


@pytest.fixture(scope="session")
def synthetic() -> Callable[..., RunRecord]:
    return _synthetic
