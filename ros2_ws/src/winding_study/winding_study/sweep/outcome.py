"""What one run of a sweep leaves behind, whether it went well or not."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from cable_fem_node.dynamics.state import SolverError
from cable_fem_node.winding.prediction import PlannedRun
from winding_core.markers import is_wound
from winding_study.runs.run_store import Arrays, RunStore, canonical_text
from winding_study.runs.solver_version import solver_version

OK = "ok"

# Exit code of a worker whose parent is gone.
ORPHANED = 3


class SolverMismatchError(RuntimeError):
    """A worker has another solver than the process that asked it."""


def attempt(run: PlannedRun, cpu_clock: Callable[[], float] = time.process_time) -> Arrays:
    """Wind a run and return its results; a failed run has a sentence for its status.

    Returns:
        status: `ok` or why the run failed.
        inputs: The run as JSON in SI units.
        cpu_seconds: Processor time [s].
        theta, z, s: Of P1..Pn [rad, m, m], shape (n,), NaN where a marker is not wound.
        stretch, stretch_closed_form, span_stretch: As of a prediction.
        cable_per_turn, pitch_per_turn: Of complete turns [m], shape (turns,).
        energy_balance_pct, kinetic_over_internal: Of the energy ledger.
    """
    results: dict[str, ArrayLike] = {"inputs": canonical_text(run)}
    started = cpu_clock()
    try:
        found = run.wind()
    except (ValueError, ArithmeticError, SolverError) as error:
        results |= {"status": " ".join(str(error).split()), "cpu_seconds": cpu_clock() - started}
    else:
        markers = found.markers[1:]
        wound = is_wound(markers)
        results |= {
            "status": OK,
            "cpu_seconds": found.cpu_seconds,
            **{name: np.where(wound, markers[name], np.nan) for name in ("theta", "z", "s")},
            "stretch": found.stretch,
            "stretch_closed_form": found.stretch_closed_form,
            "span_stretch": found.span_stretch,
            "cable_per_turn": found.cable_per_turn(),
            "pitch_per_turn": found.pitch_per_turn(),
            "energy_balance_pct": found.energy.balance_pct,
            "kinetic_over_internal": found.energy.kinetic_over_internal,
        }
    return {name: np.asarray(value) for name, value in results.items()}


def wind_batch(
    batch: Sequence[tuple[str, PlannedRun]],
    store: RunStore | None,
    version: str,
    parent: int | None,
) -> list[tuple[str, Arrays]]:
    """Wind some runs in a worker process, keeping each as soon as it is done.

    Args:
        batch: Keys and runs.
        store: Where this process keeps results and finds those of a worker that was killed;
            None where the worker has no part in the store.
        version: The solver that the keys were made for.
        parent: Process that started this one; when it is gone, this one ends after the run
            that it has in hand. None: stay in any case.

    Raises:
        SolverMismatchError: This process has another solver.
        OSError: The store cannot be written.
    """
    if solver_version() != version:
        raise SolverMismatchError(
            f"a worker has solver {solver_version()}, this machine {version}: "
            "install the same version on both"
        )
    if parent is not None:
        # Ctrl-C reaches the whole process group; the parent decides what to do about it.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    results = []
    for key, run in batch:
        if parent is not None and os.getppid() != parent:
            # Killed without a word: this process and its queue are nobody's any more.
            os._exit(ORPHANED)
        found = store.load(key, _named_already) if store is not None else None
        if found is None:
            found = attempt(run)
            if store is not None:
                store.save(key, found)
        results.append((key, found))
    return results


def _named_already(sentence: str) -> None:
    """Say nothing: the process that asks looked the run up before and named the damage."""
