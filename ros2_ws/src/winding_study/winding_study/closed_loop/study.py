"""The twelve cases under hidden rigs, with the loop closed and open: where the markers land."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import joblib
import numpy as np
from numpy.typing import NDArray

from lay_control_node.control.control_parameters import ControlParameters
from lay_control_node.control.wanted_program import WantedProgram
from lay_control_node.planning.limits import PlanLimits
from lay_control_node.programs.simple_programs import even_helix
from winding_core.condition import Condition
from winding_core.lay_control_records import ControlMode
from winding_rig_node.machine.hidden_rig import HiddenRig
from winding_study.closed_loop.run import ClosedRun, wind

Array = NDArray[np.float64]
Progress = Callable[[int, int], None]

_FULL_TURN = 2.0 * math.pi
# The hidden cable is neo-Hookean, and that is no secret: the paper's rig is best told with it.
_LAW = "neo_hookean"
MODES = {"closed": ControlMode.DRIVE, "open": ControlMode.WATCH}


@dataclass(frozen=True, kw_only=True)
class ClosedLoopConfig:
    """What is wound.

    Attributes:
        cases: Rows of Table 1.
        draws: Hidden rigs of each case.
        truths: Of `TRUTHS`.
        sees_lay: Whether every turn is measured, or markers alone.
        first_seed: Of the hidden rigs.
    """

    cases: tuple[int, ...]
    draws: int
    truths: tuple[str, ...] = ("driven", "rod")
    sees_lay: bool = True
    first_seed: int = 0

    def __post_init__(self) -> None:
        if self.draws < 1:
            raise ValueError(f"draws must be 1 or more, got {self.draws}")


@dataclass(frozen=True, kw_only=True)
class ClosedLoopRow:
    """One run: what was hidden, and how far the cable lies from the even helix.

    Attributes:
        case: Row of Table 1.
        seed: Of the hidden rig.
        truth: Of `TRUTHS`.
        mode: closed or open.
        marker_error: z less the helix at P1 and on [m], shape (m,); nan for one not landed.
        turn_rms: Of each complete turn [m], shape (n,).
        free_length: Hidden [m].
        estimated_length: At the end [m].
        sigma_length: Of that [m].
    """

    case: int
    seed: int
    truth: str
    mode: str
    marker_error: Array
    turn_rms: Array
    free_length: float
    estimated_length: float
    sigma_length: float

    def record(self) -> dict[str, Any]:
        """Return the row for a file of JSON."""
        return {
            "case": self.case,
            "seed": self.seed,
            "truth": self.truth,
            "mode": self.mode,
            "marker_error_mm": [_known(1.0e3 * value) for value in self.marker_error],
            "turn_rms_mm": [_known(1.0e3 * value) for value in self.turn_rms],
            "free_length_m": self.free_length,
            "estimated_free_length_m": self.estimated_length,
            "sigma_free_length_m": self.sigma_length,
        }


def planned(config: ClosedLoopConfig) -> Iterator[tuple[int, int, str, str]]:
    """Yield case, seed, truth and mode of every run."""
    for case in config.cases:
        for seed in range(config.first_seed, config.first_seed + config.draws):
            for truth in config.truths:
                for mode in MODES:
                    yield case, seed, truth, mode


def closed_loop_study(
    config: ClosedLoopConfig, *, processes: int, progress: Progress
) -> list[ClosedLoopRow]:
    """Wind every run of a study; the order is that of `planned`.

    Args:
        config: What is wound.
        processes: At a time.
        progress: Called with the runs done and those there are.
    """
    runs = list(planned(config))
    rows = []
    work = joblib.Parallel(n_jobs=processes, return_as="generator")(
        joblib.delayed(_wound)(*run, sees_lay=config.sees_lay) for run in runs
    )
    for row in work:
        rows.append(row)
        progress(len(rows), len(runs))
    return rows


def summary(rows: list[ClosedLoopRow]) -> dict[tuple[str, str], Mapping[str, Array]]:
    """Return percentiles over the runs, by truth and mode.

    The 50th, 95th and 100th percentile of |z error| at each marker and of the rms of the turns
    after the second [m], shape (3,) each; of markers that landed.
    """
    found: dict[tuple[str, str], Mapping[str, Array]] = {}
    for truth, mode in sorted({(row.truth, row.mode) for row in rows}):
        chosen = [row for row in rows if (row.truth, row.mode) == (truth, mode)]
        most = max(row.marker_error.size for row in chosen)
        parts: dict[str, Array] = {}
        for n in range(most):
            errors = np.array([row.marker_error[n] for row in chosen if row.marker_error.size > n])
            parts[f"P{n + 1}"] = _percentiles(np.abs(errors))
        parts["turns"] = _percentiles(np.concatenate([row.turn_rms[2:] for row in chosen]))
        found[truth, mode] = parts
    return found


def _wound(case: int, seed: int, truth: str, mode: str, *, sees_lay: bool) -> ClosedLoopRow:
    what = Condition(case=case, law=_LAW).resolved()
    control = ControlParameters()
    turns = what.drive.positions(what.duration)[0] / _FULL_TURN
    program = even_helix(what.drive.pitch, turns + 2.0)
    limits = PlanLimits(
        cylinder_speed=what.drive.angular_speed,
        cylinder_acceleration=what.drive.angular_speed / what.drive.ramp_time,
        carriage_speed=control.guide_speed_limit,
        carriage_acceleration=control.guide_acceleration_limit,
        carriage_jerk=1.0e3 * control.guide_acceleration_limit,
        travel=(control.guide_travel[0], control.guide_travel[1]),
        brake=None,
        brake_time=0.0,
    )
    hidden = HiddenRig.drawn(np.random.default_rng((case, seed)))
    run = ClosedRun(
        what=what,
        wanted=WantedProgram.of(program, what, limits),
        end=_FULL_TURN * turns,
        truth=truth,
        hidden=hidden,
        control=control,
        mode=MODES[mode],
        sees_lay=sees_lay,
        seed=seed,
    )
    result = wind(run)
    lay = result.setpoints[-1].lay
    return ClosedLoopRow(
        case=case,
        seed=seed,
        truth=truth,
        mode=mode,
        marker_error=result.marker_error,
        turn_rms=result.turn_rms(),
        free_length=hidden.free_length,
        estimated_length=lay.free_length,
        sigma_length=lay.sigma_length,
    )


def _percentiles(values: Array) -> Array:
    known = values[np.isfinite(values)]
    if not known.size:
        return np.full(3, np.nan)
    return np.asarray(np.percentile(known, (50.0, 95.0, 100.0)))


def _known(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
