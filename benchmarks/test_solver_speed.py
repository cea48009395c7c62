"""Speed of the solver on case 4 beside plain loops of the same length, in one session.

A bar is a ratio of two processor times that are measured in turn, so it holds on any computer.
Kernels are warm: each measurement is repeated and the best one counts, so the first, which may
compile, never does. What other processes do on the machine can only make a repeat slower.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pytest

from cable_fem_node.dynamics.compile import kernel
from cable_fem_node.winding.prediction import predict
from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.solid_winding import SolidWinding
from cable_fem_node.winding.winding_config import WindingConfig
from rows import least
from winding_core.cable.cases import paper_case
from winding_core.machine.drive import DriveProfile
from winding_study.paper.study import StudyConfig, wind_cases

REPEATS = 5
# Measured 3.6 and 13 on two shared cores; the rest is for other processors.
ROD_OVER_STRING = 6.0
SOLID_OVER_ROD = 20.0
DRIVE = DriveProfile()
SEGMENT = 5.0e-3

# Far from the true density, so that a short measurement sees the cable lie on the cylinder; the
# cost of an element-step does not know about mass.
SOLID_MASS_SCALING = 1500.0


@kernel
def string_steps(x: np.ndarray, v: np.ndarray, f: np.ndarray, length: float, steps: int) -> None:
    """Advance a string of masses and springs: the least that an explicit cable computes."""
    for _ in range(steps):
        f[:] = 0.0
        for e in range(x.shape[0] - 1):
            dx = x[e + 1, 0] - x[e, 0]
            dy = x[e + 1, 1] - x[e, 1]
            dz = x[e + 1, 2] - x[e, 2]
            current = np.sqrt(dx * dx + dy * dy + dz * dz)
            pull = (current - length) / current
            f[e, 0] += pull * dx
            f[e, 1] += pull * dy
            f[e, 2] += pull * dz
            f[e + 1, 0] -= pull * dx
            f[e + 1, 1] -= pull * dy
            f[e + 1, 2] -= pull * dz
        for i in range(1, x.shape[0] - 1):
            for axis in range(3):
                v[i, axis] += 0.01 * f[i, axis]
                x[i, axis] += 0.1 * v[i, axis]


def drive_to(model: RodWinding | SolidWinding, t: float) -> None:
    """Advance a model along the paper's drive."""
    model.advance_to(t, DRIVE.reading_at(t))


def string_of(elements: int, steps: int) -> Callable[[], float]:
    """Return a measurement of the plain string [ns per element-step]."""
    x = np.zeros((elements + 1, 3))
    x[:, 0] = np.linspace(0.0, elements * 1.01, elements + 1)
    v, f = np.zeros_like(x), np.zeros_like(x)

    def measure() -> float:
        started = time.process_time()
        string_steps(x, v, f, 1.0, steps)
        return 1.0e9 * (time.process_time() - started) / (elements * steps)

    return measure


def model_of(model: RodWinding | SolidWinding, seconds: float, spans: int) -> Callable[[], float]:
    """Return a measurement of a model that advances by equal spans [ns per element-step]."""

    def measure() -> float:
        begin, done, started = model.time, model.element_steps, time.process_time()
        for i in range(1, spans + 1):
            drive_to(model, begin + seconds * i / spans)
        return 1.0e9 * (time.process_time() - started) / (model.element_steps - done)

    return measure


def wound_rod() -> RodWinding:
    """Return case 4 when two thirds of the elements lie on the cylinder."""
    model = RodWinding(WindingConfig(case=paper_case(4), segment_length=SEGMENT, rests=False))
    drive_to(model, 14.0)
    assert model.wound_path()[0].size > 0.6 * model.nodes
    return model


def test_rod_kernel_beside_a_plain_string(bench):
    model = wound_rod()
    # Elements are counted as they stand at the end of a span: spans are short.
    rod, string = least(REPEATS, model_of(model, 1.0, 20), string_of(model.nodes - 1, 20_000))
    bench.row("rod_kernel_ns_per_element_step", rod, "ns")
    bench.row("plain_string_ns_per_element_step", string, "ns")
    bench.row("rod_over_plain_string", rod / string, "", bar=ROD_OVER_STRING)


def test_solid_kernel_beside_the_rod(bench):
    config = WindingConfig(
        case=paper_case(4), segment_length=SEGMENT, mass_scaling=SOLID_MASS_SCALING
    )
    model = SolidWinding(config, 3.0)
    # 1.3 rad: four sections lie on the cylinder, with friction.
    drive_to(model, 1.25)
    assert model.wound_path()[0].size >= 4
    solid, rod = least(REPEATS, model_of(model, 0.1, 1), model_of(wound_rod(), 1.0, 20))
    bench.row("solid_ns_per_element_step", solid, "ns")
    bench.row("solid_over_rod", solid / rod, "", bar=SOLID_OVER_ROD)


def test_prediction_of_case_4(bench):
    config = WindingConfig(case=paper_case(4), segment_length=SEGMENT)
    runs = [predict(config) for _ in range(3)]
    best = min(run.cpu_s_per_sim_s for run in runs)
    bench.row("rod_case4_cpu_s_per_sim_s", best, "CPU s/s")


@pytest.mark.slow
def test_all_cases_on_two_processes(bench):
    started = time.perf_counter()
    results = wind_cases(
        StudyConfig(segment_length=SEGMENT), progress=lambda result: None, processes=2
    )
    bench.row("rod_12_cases_wall_s", time.perf_counter() - started, "s wall, 2 processes")
    bench.row("rod_12_cases_cpu_s", sum(result.cpu_seconds for result in results), "CPU s")
    assert len(results) == 12
