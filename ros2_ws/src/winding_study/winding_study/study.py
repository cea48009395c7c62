"""The paper's twelve cases wound ahead with this project's rod, nothing fitted to any of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import joblib

from cable_fem_node.winding import DeadWeight, TensionLaw, WindingConfig, predict
from cable_winding.cases import paper_case
from cable_winding.drive import PAPER_DURATION, DriveProfile
from cable_winding.fleet import PAPER_FREE_LENGTH
from cable_winding.markers import is_wound
from cable_winding.published import Lay, published_conditions, published_markers

PROCESSES = 2


@dataclass(frozen=True, kw_only=True)
class StudyConfig:
    """What all cases share.

    Attributes:
        law: Material law of the rod.
        segment_length: Reference length of an element [m].
        free_length: Tangent span between cylinder and guide [m], one for all cases.
        tension_law: Span tension; the dead weight unless the rig is calibrated.
        drive: Speeds over time.
        duration: Simulated length of each run [s].
    """

    law: str = "linear"
    segment_length: float = 5.0e-3
    free_length: float = PAPER_FREE_LENGTH
    tension_law: TensionLaw = field(default_factory=DeadWeight)
    drive: DriveProfile = field(default_factory=DriveProfile)
    duration: float = PAPER_DURATION


@dataclass(frozen=True, kw_only=True)
class CaseResult:
    """One case wound to its end.

    Attributes:
        case: Row of Table 1.
        lays: Where each wound marker lies, by marker number; an unwound marker is missing.
        path_z: z [m] of the predicted path at the measured theta, by marker number.
        energy_balance_pct: What the energy ledger cannot explain.
        cpu_seconds: Processor time of the run [s].
    """

    case: int
    lays: dict[int, Lay]
    path_z: dict[int, float]
    energy_balance_pct: float
    cpu_seconds: float


def wind_case(number: int, config: StudyConfig) -> CaseResult:
    """Wind one case of Table 1 ahead.

    Raises:
        ValueError: The case does not exist, or the law cannot carry its weight.
    """
    prediction = predict(
        WindingConfig(
            case=paper_case(number),
            law=config.law,
            segment_length=config.segment_length,
            free_length=config.free_length,
            tension_law=config.tension_law,
        ),
        config.drive,
        config.duration,
    )
    wound = prediction.markers[is_wound(prediction.markers)]
    reached = prediction.theta[-1]
    return CaseResult(
        case=number,
        lays={
            int(m["id"]): Lay(theta=float(m["theta"]), z=float(m["z"]), s=float(m["s"]))
            for m in wound
            if m["id"] > 0
        },
        path_z={
            row.marker: float(prediction.z_at(row.experiment.theta))
            for row in published_markers(number)
            if row.experiment is not None and row.experiment.theta <= reached
        },
        energy_balance_pct=float(prediction.energy.balance_pct),
        cpu_seconds=prediction.cpu_seconds,
    )


def wind_cases(
    config: StudyConfig,
    progress: Callable[[CaseResult], None],
    cases: Iterable[int] | None = None,
    processes: int = PROCESSES,
) -> tuple[CaseResult, ...]:
    """Wind cases in parallel processes and return them in order.

    Args:
        config: What all cases share.
        progress: Called in this process with each case as it ends.
        cases: Rows of Table 1; all twelve by default.
        processes: How many at a time.
    """
    numbers = tuple(published_conditions() if cases is None else cases)
    running = joblib.Parallel(n_jobs=processes, return_as="generator_unordered")(
        joblib.delayed(wind_case)(number, config) for number in numbers
    )
    results = {}
    for result in running:
        results[result.case] = result
        progress(result)
    return tuple(results[number] for number in numbers)


def predicted_lengths(results: Iterable[CaseResult]) -> list[tuple[int, int, float]]:
    """Return (case, marker, S_FEM [m]) of every wound marker, in order."""
    return [
        (result.case, marker, lay.s) for result in results for marker, lay in result.lays.items()
    ]
