"""The paper's 20 s wound by the rod and by the plainest explicit rod in C, in one session."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cable_fem_node.winding.prediction import PlannedRun
from cable_fem_node.winding.winding_config import WindingConfig
from floors.rod_in_c import OPTIONS, REORDERED, compiler
from winding_core.cable.cases import paper_case

SOURCE = Path(__file__).parent / "peers" / "plain_rod.c"
# What the project promises over the whole run, calls from Python and markers at 50 Hz included.
ROD_OVER_C = 2.0
# The plain rod has no clamp at P0; measured 5e-6.
SAME_S = 1.0e-4
REPEATS = 3


def arguments(run: PlannedRun) -> list[str]:
    """Return the plain rod's arguments in its order."""
    config, drive, resolved = run.config, run.drive, run.config.resolved
    case, k = config.case, resolved.constants
    landing = float(np.interp(resolved.tension, resolved.responses[0], resolved.responses[2]))
    values = (
        *(run.duration, drive.angular_speed, drive.ramp_time, drive.advance_per_radian),
        *(case.material.young * case.axial_area, k.bending, k.mass, k.segment, resolved.tension),
        *(config.friction, config.free_length, k.contact_line, landing, k.touch.normal_stiffness),
        *(k.damping_rate, resolved.step, case.marker_spacing, case.marker_count),
    )
    return [repr(float(value)) for value in values]


def test_whole_run_beside_plain_c(bench: Any, tmp_path: Path) -> None:
    command = compiler()
    if command is None:
        pytest.skip("no C compiler (cc, gcc, clang) on this machine: the rod has no floor in C")
    programs = [tmp_path / "plain_rod", tmp_path / "plain_rod_reordered"]
    for program, further in zip(programs, ((), REORDERED), strict=True):
        subprocess.run([command, *OPTIONS, *further, "-o", program, SOURCE, "-lm"], check=True)
    run = PlannedRun(config=WindingConfig(case=paper_case(4)))
    ours, floor = [], []
    for _ in range(REPEATS):
        result = run.wind(whole=False)
        ours.append(result.cpu_seconds)
        for program in programs:
            done = subprocess.run(
                [program, *arguments(run)], check=True, capture_output=True, text=True
            )
            seconds, *marks = map(float, done.stdout.split())
            floor.append(seconds)
            theta, z = np.reshape(marks, (-1, 2)).T
            s = np.hypot(run.config.case.centreline_radius * theta, z)
            np.testing.assert_allclose(s, result.markers["s"][1:], rtol=SAME_S)
    bench.ratio("rod_over_plain_c_20_s", min(ours), min(floor), bar=ROD_OVER_C)
