"""The twelve cases under hidden rigs, with the loop closed and open: where the markers land."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

import joblib
import numpy as np
from numpy.typing import NDArray

from lay_control_node.control.control_parameters import ControlParameters
from lay_control_node.control.expected_landing import expected_landings
from lay_control_node.control.guide_law import WantedLay, WantedProgram
from lay_control_node.programs.simple_programs import even_helix
from winding_core.cable.condition import Condition, ResolvedCondition
from winding_core.lay.records import ControlMode
from winding_core.units import known
from winding_rig_node.lay.lay_on import HiddenRig
from winding_verification.closed_loop.run import ClosedRun, wind

Array = NDArray[np.float64]
Progress = Callable[[int, int], None]

_FULL_TURN = 2.0 * math.pi
# The law of the hidden cable is known to the controller: it describes the paper's rig best.
_LAW = "neo_hookean"
# Markers are wanted where this share of the weight lands them, in the middle of 0.3 to 1.5; a run
# goes on for so many radians behind the last one.
_MIDDLE_PULL, _BEYOND = 0.9, 2.0
_STEP = 0.02
# Turns by which P1 and those behind it may miss their angles under a brake that can reach them.
MISS_BARS = (0.02, 0.01)
MODES = {"closed": ControlMode.DRIVE, "open": ControlMode.WATCH}


@dataclass(frozen=True, kw_only=True)
class ClosedLoopConfig:
    """What is wound."""

    cases: tuple[int, ...]  # Rows of Table 1
    draws: int  # Hidden rigs of each case
    # driven, rod or both: which cables are the true ones.
    truths: tuple[str, ...] = ("driven", "rod")
    first_seed: int = 0  # Of the hidden rigs
    brake: bool = False  # Whether a brake lands markers at angles that are within its reach

    def __post_init__(self) -> None:
        if self.draws < 1:
            raise ValueError(f"draws must be 1 or more, got {self.draws}")


@dataclass(frozen=True, kw_only=True)
class ClosedLoopRow:
    """One run: what was hidden, and how far the cable lies from the even helix."""

    case: int  # Row of Table 1
    seed: int  # Of the hidden rig
    truth: str  # driven or rod
    mode: str  # closed or open
    marker_error: Array  # z less the helix at P1 and on [m], shape (m,); nan for one not landed
    turn_rms: Array  # Of each complete turn [m], shape (n,)
    # Angle of P1 and on less the wanted one [rad], shape (m,); nan for one that has not landed,
    # empty without a brake.
    marker_miss: Array
    expected_miss: Array  # Two deviations of each as predicted beforehand [rad]; shape as above
    free_length: float  # Hidden [m]
    estimated_length: float  # At the end [m]
    sigma_length: float  # Of that [m]

    def record(self) -> dict[str, Any]:
        """Return the row for a file of JSON."""
        return {
            "case": self.case,
            "seed": self.seed,
            "truth": self.truth,
            "mode": self.mode,
            "marker_error_mm": [known(1.0e3 * value) for value in self.marker_error],
            "turn_rms_mm": [known(1.0e3 * value) for value in self.turn_rms],
            "marker_miss_turns": [known(value / _FULL_TURN) for value in self.marker_miss],
            "said_miss_turns": [known(value / _FULL_TURN) for value in self.expected_miss],
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
        joblib.delayed(_wound)(*run, config) for run in runs
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
        errors = _by_marker(row.marker_error for row in chosen)
        parts = {f"P{n}": _percentiles(np.abs(own)) for n, own in enumerate(errors, 1)}
        parts["turns"] = _percentiles(np.concatenate([row.turn_rms[2:] for row in chosen]))
        found[truth, mode] = parts
    return found


def _wound(case: int, seed: int, truth: str, mode: str, config: ClosedLoopConfig) -> ClosedLoopRow:
    what = Condition(case=case, law=_LAW).resolved()
    control = ControlParameters()
    turns = what.drive.positions(what.duration)[0] / _FULL_TURN
    program = even_helix(what.drive.pitch, turns + 2.0)
    hidden = HiddenRig.drawn(np.random.default_rng((case, seed)))
    wanted = WantedProgram.of(program, what, control.limits(what))
    markers = _within_reach(control, what, wanted) if config.brake else {}
    run = ClosedRun(
        what=what,
        wanted=wanted,
        markers=markers,
        end=max([_FULL_TURN * turns, *(angle + _BEYOND for angle in markers.values())]),
        truth=truth,
        hidden=hidden,
        control=control,
        mode=MODES[mode],
        seed=seed,
    )
    result = wind(run)
    lay = result.setpoints[-1].lay
    expected = expected_landings(control, what, wanted, markers)
    return ClosedLoopRow(
        case=case,
        seed=seed,
        truth=truth,
        mode=mode,
        marker_error=result.marker_error,
        turn_rms=result.turn_rms(),
        marker_miss=np.array([result.marker_theta[n - 1] - angle for n, angle in markers.items()]),
        expected_miss=np.array([item.misses for item in expected]),
        free_length=hidden.free_length,
        estimated_length=lay.free_length,
        sigma_length=lay.sigma_length,
    )


def _within_reach(
    control: ControlParameters, what: ResolvedCondition, wanted: WantedLay
) -> dict[int, float]:
    """Return where markers land [rad] under a share of the weight, without errors."""
    case = what.case
    watching = control.controller(what, wanted, markers={1: 1.0}, mode=ControlMode.WATCH)
    assert watching.landing is not None
    theta = np.arange(_STEP, 2.0 * _FULL_TURN * (case.marker_count + 1), _STEP)
    slope = wanted.slopes(theta)
    tension = watching.stretch.estimate.tension(
        _MIDDLE_PULL * case.weight, case.centreline_radius * theta
    )
    laid = np.cumsum(watching.landing.law.density(tension, slope) * _STEP)
    numbers = range(1, case.marker_count + 1)
    return {n: float(np.interp(n * case.marker_spacing, laid, theta)) for n in numbers}


def verdict(rows: list[ClosedLoopRow], tolerance: float) -> str:
    """Return one sentence: whether the turns lie within a tolerance under control, and without.

    Args:
        rows: Of a study.
        tolerance: Of the rms distance from the helix, of every turn after the second [m].
    """
    worst = {
        mode: max((part["turns"][2] for (_, of), part in summary(rows).items() if of == mode))
        for mode in MODES
    }
    kept = worst["closed"] <= tolerance
    return (
        f"{'good' if kept else 'not good'}: under control no turn after the second lies further "
        f"than {1.0e3 * worst['closed']:.2f} mm (rms) from where it is wanted, "
        f"limit {1.0e3 * tolerance:g} mm; without control {1.0e3 * worst['open']:.2f} mm"
    )


def miss_summary(rows: list[ClosedLoopRow]) -> dict[str, Mapping[str, Array]]:
    """Return percentiles of how far markers missed their angles under control, by truth.

    The 50th, 95th and 100th percentile of |miss| by marker in turns, shape (3,) each, and for
    every marker under `expected` the share of runs within what was predicted, or within its
    bar, 0.02 turns of P1 and 0.01 of others, shape (1,).
    """
    found: dict[str, Mapping[str, Array]] = {}
    closed = [row for row in rows if row.mode == "closed" and row.marker_miss.size]
    for truth in sorted({row.truth for row in closed}):
        chosen = [row for row in closed if row.truth == truth]
        parts: dict[str, Array] = {}
        misses = _by_marker(row.marker_miss for row in chosen)
        limits = _by_marker(row.expected_miss for row in chosen)
        for n, pair in enumerate(zip(misses, limits, strict=True), 1):
            miss, expected = np.abs(pair) / _FULL_TURN
            known = np.isfinite(miss)
            parts[f"P{n}"] = _percentiles(miss)
            held = miss[known] <= np.maximum(expected[known], MISS_BARS[min(n, 2) - 1])
            parts[f"P{n} expected"] = np.array([held.mean() if held.size else np.nan])
        found[truth] = parts
    return found


def _by_marker(runs: Iterable[Array]) -> Array:
    """Return numbers of runs by marker, shape (markers, runs); nan where a run has none."""
    return np.array(list(zip_longest(*runs, fillvalue=np.nan)))


def _percentiles(values: Array) -> Array:
    known = values[np.isfinite(values)]
    if not known.size:
        return np.full(3, np.nan)
    return np.asarray(np.percentile(known, (50.0, 95.0, 100.0)))
