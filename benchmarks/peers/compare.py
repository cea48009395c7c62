"""Winds the same seconds with every peer and with the rod, and prints their cost and their lay.

Each solver runs alone in a process of its own, one after the other, single-threaded.

Run with: make bench-peers, or python benchmarks/peers/compare.py --duration 2
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from winding_problem import Marks, Outcome, WindingProblem, no_slip_marks

from winding_core.units import MILLIMETRE

sys.path.insert(0, str(Path(__file__).parents[1]))
from rows import SINGLE_THREAD, Bench, keep

# P4 of the most stretched cable has landed by then.
DURATION = 16.5

PEER_PACKAGES = ("elastica", "mujoco")


def _rod(problem: WindingProblem) -> Outcome:
    from cable_fem_node.winding.prediction import predict
    from cable_fem_node.winding.rod_winding import RodWinding
    from cable_fem_node.winding.winding_config import WindingConfig

    config = WindingConfig(
        case=problem.case,
        friction=problem.friction,
        segment_length=problem.segment_length,
        free_length=problem.free_length,
    )
    run = predict(config, problem.drive, problem.duration)
    marks = run.markers[1:]
    return Outcome(
        solver="this project's rod",
        version=version("cable-winding-twin"),
        step=RodWinding(config).step_limit,
        elements=run.cable.size - 1,
        cpu_seconds=run.cpu_seconds,
        duration=run.duration,
        diverged=False,
        stretch=problem.stretch,
        wound_radius=problem.radius,
        marks=Marks(theta=marks["theta"], z=marks["z"], s=marks["s"], wound=marks["flags"] == 0),
    )


def _pyelastica(memory: bool) -> Callable[[WindingProblem], Outcome]:
    def run(problem: WindingProblem) -> Outcome:
        from pyelastica_winding import wind

        return wind(problem, memory=memory)

    return run


def _mujoco(mode: str) -> Callable[[WindingProblem], Outcome]:
    def run(problem: WindingProblem) -> Outcome:
        from mujoco_winding import wind

        return wind(problem, mode=mode)

    return run


OURS = "rod"
SOLVERS: dict[str, Callable[[WindingProblem], Outcome]] = {
    OURS: _rod,
    "pyelastica": _pyelastica(memory=False),
    "pyelastica_memory": _pyelastica(memory=True),
    "mujoco_inextensible": _mujoco("inextensible"),
    "mujoco_tendon": _mujoco("tendon"),
    "mujoco_edge": _mujoco("edge"),
}


def _wind_apart(name: str, duration: float) -> Outcome:
    """Run one solver in a process of its own."""
    finished = subprocess.run(
        [sys.executable, __file__, "--alone", name, "--duration", str(duration)],
        env={**os.environ, **SINGLE_THREAD},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    return Outcome.from_json(json.loads(finished.stdout.splitlines()[-1]))


def _deviation(outcome: Outcome, problem: WindingProblem) -> tuple[np.ndarray, np.ndarray]:
    """Return (S [%], z [m]) over the no-slip reference of the same law, NaN before landing."""
    exact = no_slip_marks(problem, outcome.stretch, outcome.wound_radius)
    landed = outcome.marks.wound & exact.wound
    return (
        np.where(landed, 100.0 * (outcome.marks.s / exact.s - 1.0), np.nan),
        np.where(landed, outcome.marks.z - exact.z, np.nan),
    )


def _listed(values: np.ndarray, digits: int) -> str:
    return " / ".join("-" if np.isnan(v) else f"{v:.{digits}f}" for v in values)


def _table(outcomes: dict[str, Outcome], problem: WindingProblem) -> Table:
    table = Table(
        title=f"Case {problem.case.number}, {problem.segment_length / MILLIMETRE:g} mm segments, "
        f"{problem.duration:g} s wound; differences against the no-slip reference of each law"
    )
    for column in ("solver", "step, us", "CPU s/s", "over ours", "S, mm", "dS, %", "z, mm"):
        table.add_column(column, justify="left" if column == "solver" else "right")
    table.add_column("dz, mm", justify="right")
    ours = outcomes[OURS]
    for outcome in outcomes.values():
        ds, dz = _deviation(outcome, problem)
        landed = np.where(outcome.marks.wound, 1.0, np.nan)
        ended = f", diverged by {outcome.duration:.2f} s" if outcome.diverged else ""
        table.add_row(
            f"{outcome.solver} ({outcome.version}){ended}",
            f"{1e6 * outcome.step:.1f}",
            f"{outcome.cpu_s_per_sim_s:.4g}",
            f"{outcome.cpu_s_per_sim_s / ours.cpu_s_per_sim_s:.3g}",
            _listed(outcome.marks.s * landed / MILLIMETRE, 1),
            _listed(ds, 2),
            _listed(outcome.marks.z * landed / MILLIMETRE, 2),
            _listed(dz / MILLIMETRE, 2),
        )
    return table


def _collect(bench: Bench, outcomes: dict[str, Outcome], problem: WindingProblem) -> None:
    ours = outcomes[OURS]
    for name, outcome in outcomes.items():
        if outcome.diverged:
            continue
        bench.row(f"peers_{name}_cpu_s_per_sim_s", outcome.cpu_s_per_sim_s, "CPU s/s")
        if name != OURS:
            ratio = outcome.cpu_s_per_sim_s / ours.cpu_s_per_sim_s
            bench.row(f"peers_{name}_over_rod", ratio, "times our cost", bar=1.0, at_least=True)
        ds, dz = _deviation(outcome, problem)
        if np.isfinite(ds).any():
            bench.row(f"peers_{name}_worst_ds_pct", float(np.nanmax(np.abs(ds))), "%")
            bench.row(f"peers_{name}_worst_dz_mm", float(np.nanmax(np.abs(dz))) / MILLIMETRE, "mm")


def main() -> int:
    """Compare all solvers, or run one of them and print its outcome as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--duration", type=float, default=DURATION, help="simulated seconds")
    parser.add_argument("--alone", choices=SOLVERS, help="run one solver, print JSON")
    arguments = parser.parse_args()
    if not 0.1 <= arguments.duration <= 60.0:
        parser.error(f"duration must lie in 0.1 to 60 s, got {arguments.duration:g}")
    problem = WindingProblem(duration=arguments.duration)
    if arguments.alone is not None:
        print(json.dumps(SOLVERS[arguments.alone](problem).as_json()))
        return 0
    missing = [name for name in PEER_PACKAGES if importlib.util.find_spec(name) is None]
    if missing:
        parser.error(f"{', '.join(missing)} not installed: use `make bench-peers`")
    console = Console(width=None if sys.stdout.isatty() else 180)
    outcomes = {}
    for name in SOLVERS:
        console.print(f"winding {problem.duration:g} s with {name}")
        outcomes[name] = _wind_apart(name, problem.duration)
    console.print(_table(outcomes, problem))
    bench = Bench()
    _collect(bench, outcomes, problem)
    keep(bench.rows.values())
    if not all(row.met for row in bench.rows.values()):
        console.print("a peer is faster than the rod")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
