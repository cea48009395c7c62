"""Speed of the solver on case 4, in processor time of one thread; every bar is the specification's.

Kernels are warm: each measurement is repeated and the best one counts, so the first, which may
compile, never does. What other processes do on the machine can only make a repeat slower.
"""

from __future__ import annotations

import time

import pytest

from cable_fem_node.winding.prediction import predict
from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.solid_winding import SolidWinding
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.cases import paper_case
from winding_core.drive import DriveProfile
from winding_study.paper.study import StudyConfig, wind_cases

REPEATS = 3
DRIVE = DriveProfile()
SEGMENT = 5.0e-3

# Far from the true density, so that a short measurement sees the cable lie on the cylinder; the
# cost of an element-step does not know about mass.
SOLID_MASS_SCALING = 1500.0


def drive_to(model: RodWinding | SolidWinding, t: float) -> None:
    """Advance a model along the paper's drive."""
    angle, guide = DRIVE.positions(t)
    speed, feed = DRIVE.speeds(t)
    model.advance_to(t, cylinder_angle=angle, angular_speed=speed, guide_z=guide, feed_speed=feed)


def ns_per_element_step(model: RodWinding | SolidWinding, seconds: float, spans: int) -> float:
    """Advance by so many equal spans and return the processor time of an element's step [ns]."""
    begin, done, started = model.time, model.element_steps, time.process_time()
    for i in range(1, spans + 1):
        drive_to(model, begin + seconds * i / spans)
    return 1.0e9 * (time.process_time() - started) / (model.element_steps - done)


def test_rod_winds_case_4_far_faster_than_real_time(bench):
    config = WindingConfig(case=paper_case(4), segment_length=SEGMENT)
    runs = [predict(config) for _ in range(REPEATS)]
    row = bench.row(
        "rod_case4_cpu_s_per_sim_s", min(run.cpu_s_per_sim_s for run in runs), "CPU s/s", bar=0.06
    )
    assert row.met, row


def test_rod_kernel_with_contact(bench):
    model = RodWinding(WindingConfig(case=paper_case(4), segment_length=SEGMENT))
    # By then two thirds of the elements lie on the cylinder.
    drive_to(model, 14.0)
    laid = model.wound_path()[0].size
    assert laid > 0.6 * model.nodes
    # Elements are counted as they stand at the end of a span: spans are short.
    best = min(ns_per_element_step(model, 1.0, 20) for _ in range(REPEATS))
    row = bench.row("rod_kernel_ns_per_element_step", best, "ns", bar=20.0)
    assert row.met, row


def test_solid_kernel_with_contact(bench):
    config = WindingConfig(
        case=paper_case(4), segment_length=SEGMENT, mass_scaling=SOLID_MASS_SCALING
    )
    model = SolidWinding(config, 3.0)
    # 1.3 rad: four sections lie on the cylinder, with friction.
    drive_to(model, 1.25)
    assert model.path()[0].size >= 4
    best = min(ns_per_element_step(model, 0.2, 1) for _ in range(REPEATS))
    row = bench.row("solid_ns_per_element_step", best, "ns", bar=250.0)
    assert row.met, row


@pytest.mark.slow
def test_all_cases_within_a_minute_of_wall_time(bench):
    started = time.perf_counter()
    results = wind_cases(
        StudyConfig(segment_length=SEGMENT), progress=lambda result: None, processes=2
    )
    took = time.perf_counter() - started
    assert len(results) == 12
    bench.row("rod_12_cases_cpu_s", sum(result.cpu_seconds for result in results), "CPU s")
    row = bench.row("rod_12_cases_wall_s", took, "s wall, 2 processes", bar=60.0)
    assert row.met, row
