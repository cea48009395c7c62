"""The paper's twelve cases wound ahead with this project's solver, none of them fitted."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import joblib

from cable_fem_node.dynamics.state import SolverError
from cable_fem_node.winding.prediction import predict
from cable_fem_node.winding.winding_config import MASS_SCALING, WindingConfig
from winding_core.cable.cases import Case, paper_case, published_conditions
from winding_core.helix import PAPER_FREE_LENGTH
from winding_core.machine.drive import PAPER_DURATION, DriveProfile
from winding_core.machine.tension import DeadWeight, TensionLaw
from winding_core.run_options import ELEMENTS
from winding_study.paper.case_result import CaseResult, from_arrays, result_of, to_arrays
from winding_study.run_store import RunStore, run_key, solver_version

PROCESSES = 2
ROD_SEGMENT = 5.0e-3
# A wound solid element is a chord: D / 6 is a third of the wound radius, so 0.3 rad.
SOLID_SEGMENT_SHARE = 1.0 / 6.0
STORE_FORMAT = 1  # Of the arrays in the store; a store of another format is not read


@dataclass(frozen=True, kw_only=True)
class StudyConfig:
    """What all cases share."""

    element: str = "rod"  # ``rod`` or ``solid``, the paper's C3D8R
    law: str = "linear"  # Material law
    # Reference length of an element [m]; None takes 5 mm for the rod and a sixth of the cylinder's
    # diameter for the solid.
    segment_length: float | None = None
    # Factor on the density; None takes 1 for the rod and 400 for the solid.
    mass_scaling: float | None = None
    # Tangent span between cylinder and guide [m], one for all cases.
    free_length: float = PAPER_FREE_LENGTH
    # Span tension; the dead weight unless the rig is calibrated.
    tension_law: TensionLaw = field(default_factory=DeadWeight)
    drive: DriveProfile = field(default_factory=DriveProfile)  # Speeds over time
    duration: float = PAPER_DURATION  # Simulated length of each run [s]

    def __post_init__(self) -> None:
        if self.element not in ELEMENTS:
            raise ValueError(f"element must be {' or '.join(ELEMENTS)}, got {self.element!r}")

    @property
    def scaling(self) -> float:
        """Factor on the density."""
        return MASS_SCALING[self.element] if self.mass_scaling is None else self.mass_scaling

    def winding(self, case: Case) -> WindingConfig:
        """Return the model of one case.

        Raises:
            ValueError: The law cannot carry the weight, or a number is out of its range.
        """
        solid = self.element == "solid"
        segment = SOLID_SEGMENT_SHARE * case.cylinder_diameter if solid else ROD_SEGMENT
        return WindingConfig(
            case=case,
            law=self.law,
            segment_length=segment if self.segment_length is None else self.segment_length,
            mass_scaling=self.scaling,
            free_length=self.free_length,
            tension_law=self.tension_law,
        )

    def key(self, number: int) -> str:
        """Return the key of one case in a store: everything that decides its numbers."""
        inputs = {
            "study": STORE_FORMAT,
            "element": self.element,
            "winding": self.winding(paper_case(number)),
            "drive": self.drive,
            "duration": self.duration,
        }
        return run_key(inputs, solver_version())


class StoppedError(RuntimeError):
    """A case was given up because the study ends."""


class CaseFailedError(RuntimeError):
    """The solver gave up on a case; all others were wound first."""


def wind_case(
    number: int, config: StudyConfig, share: Callable[[float], None] | None = None
) -> CaseResult:
    """Wind one case of Table 1 ahead.

    Args:
        number: Row of Table 1.
        config: What all cases share.
        share: Called with the share of the run that is done, 0..1.

    Raises:
        ValueError: The case does not exist, or the law cannot carry its weight.
        DivergenceError: The integration failed.
        SolverError: There is no result that could be trusted.
    """
    prediction = predict(
        config.winding(paper_case(number)),
        config.drive,
        config.duration,
        share,
        element=config.element,
        # Cases run side by side in threads, so the process's clock would count the neighbours.
        cpu_clock=time.thread_time,
    )
    return result_of(number, prediction)


def wind_cases(
    config: StudyConfig,
    progress: Callable[[CaseResult], None],
    cases: Iterable[int] | None = None,
    processes: int = PROCESSES,
    store: RunStore | None = None,
    *,
    resumed: Callable[[CaseResult], None] = lambda result: None,
    share: Callable[[int, float], None] = lambda number, done: None,
    say: Callable[[str], None] = lambda sentence: None,
) -> tuple[CaseResult, ...]:
    """Wind cases side by side and return them in order.

    The kernels release the interpreter lock, so threads use as many processors as processes would.
    A case that the store has is not wound again; every other one is stored as it ends, so that
    a study which was interrupted goes on where it was.

    Args:
        config: What all cases share.
        progress: Called with each case that was wound, as it ends.
        cases: Rows of Table 1; all twelve by default.
        processes: How many at a time.
        store: Where results are kept; None keeps nothing.
        resumed: Called with each case that the store had.
        share: Called from the case's thread with how much of it is wound, 0..1.
        say: Called with one sentence about a file of the store that cannot be used.

    Raises:
        ValueError: A case does not exist, or the law cannot carry its weight; nothing is wound.
        CaseFailedError: The solver gave up on a case; the others were wound and stored.
        OSError: The store cannot be written.
    """
    numbers = tuple(published_conditions() if cases is None else cases)
    keys = {number: config.key(number) for number in numbers}
    results: dict[int, CaseResult] = {}
    failures: dict[int, Exception] = {}
    for number, key in keys.items():
        found = None if store is None else store.load(key, say)
        if found is not None:
            results[number] = from_arrays(found)
            resumed(results[number])
    stopping = threading.Event()

    def wind(number: int) -> tuple[int, CaseResult | Exception]:
        def heed(done: float) -> None:
            if stopping.is_set():
                raise StoppedError(f"case {number} given up")
            share(number, done)

        try:
            result = wind_case(number, config, heed)
        except (ValueError, SolverError) as error:
            return number, error
        if store is not None:
            store.save(keys[number], to_arrays(result))
        return number, result

    running = joblib.Parallel(
        n_jobs=processes, backend="threading", return_as="generator_unordered", pre_dispatch="all"
    )(joblib.delayed(wind)(number) for number in numbers if number not in results)
    try:
        for number, outcome in running:
            if isinstance(outcome, Exception):
                failures[number] = outcome
            else:
                results[number] = outcome
                progress(outcome)
    except BaseException:
        stopping.set()
        raise
    if failures:
        raise CaseFailedError("; ".join(f"case {n}: {failures[n]}" for n in sorted(failures)))
    return tuple(results[number] for number in numbers)


def predicted_lengths(results: Iterable[CaseResult]) -> list[tuple[int, int, float]]:
    """Return (case, marker, S_FEM [m]) of every wound marker, in order."""
    return [
        (result.case, marker, lay.s) for result in results for marker, lay in result.lays.items()
    ]
