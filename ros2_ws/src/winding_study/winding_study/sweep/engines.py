"""Who winds the runs of a sweep: what every engine promises, and the one for this machine."""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Protocol

import joblib
from joblib.externals.loky.process_executor import TerminatedWorkerError

from cable_fem_node.winding.prediction import PlannedRun
from winding_study.runs.run_store import Arrays, RunStore
from winding_study.runs.solver_version import solver_version
from winding_study.sweep.outcome import wind_batch

LARGEST_BATCH = 20

# How often in a row workers may be killed before anything new is done.
PATIENCE = 3


# After this an idle process ends [s]: soon enough when its parent was killed.
IDLE_TIME = 20.0


class EngineError(RuntimeError):
    """An engine cannot go on; what is stored stays stored."""


class Engine(Protocol):
    """Winds runs in other processes."""

    def wind(self, runs: Mapping[str, PlannedRun], store: RunStore) -> Iterator[tuple[str, Arrays]]:
        """Wind runs and yield (key, results) in any order; each is in the store when it comes.

        Raises:
            EngineError: The engine cannot go on.
            SolverMismatchError: A worker has another solver.
            OSError: The store cannot be written.
        """


def batches(
    runs: Mapping[str, PlannedRun], workers: int, largest: int = LARGEST_BATCH
) -> list[list[tuple[str, PlannedRun]]]:
    """Return runs in batches: large where runs are many, so that handing over costs little.

    Each worker gets at least four batches, so that none waits long for the last. Solid runs take
    minutes and go one by one.
    """
    size = min(largest, max(1, len(runs) // (4 * workers)))
    if any(run.element == "solid" for run in runs.values()):
        size = 1
    pairs = iter(runs.items())
    return [list(itertools.islice(pairs, size)) for _ in range(0, len(runs), size)]


@dataclass(frozen=True, kw_only=True)
class JoblibEngine:
    """Processes on this machine (joblib with loky); work of a killed process is done again.

    Attributes:
        processes: How many; one winds in this process.
    """

    processes: int = 2

    def __post_init__(self) -> None:
        if self.processes < 1:
            raise ValueError(f"processes must be at least 1, got {self.processes}")

    def wind(self, runs: Mapping[str, PlannedRun], store: RunStore) -> Iterator[tuple[str, Arrays]]:
        """Wind runs; see `Engine.wind`.

        Raises:
            EngineError: Worker processes were killed again and again.
        """
        left = dict(runs)
        parent = os.getpid() if self.processes > 1 else None
        largest, idle = LARGEST_BATCH, 0
        while left:
            running = joblib.Parallel(
                n_jobs=self.processes,
                batch_size=1,
                return_as="generator_unordered",
                idle_worker_timeout=IDLE_TIME,
            )(
                joblib.delayed(wind_batch)(batch, store, solver_version(), parent)
                for batch in batches(left, self.processes, largest)
            )
            try:
                for results in running:
                    idle = 0
                    for key, found in results:
                        del left[key]
                        yield key, found
            except TerminatedWorkerError as error:
                # One by one, so that a run that kills its process takes no other with it.
                largest, idle = 1, idle + 1
                if idle == PATIENCE:
                    raise EngineError(
                        f"worker processes were killed {idle} times in a row, perhaps for want of "
                        f"memory; {len(left)} runs are missing"
                    ) from error
