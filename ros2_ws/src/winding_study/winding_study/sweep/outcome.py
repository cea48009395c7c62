"""What the runs of a sweep leave behind, whether they went well or not: arrays, one table."""

import csv
import functools
import io
import os
import signal
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cable_fem_node.dynamics.state import SolverError
from cable_fem_node.winding.prediction import PlannedRun
from winding_core.markers import is_wound
from winding_study.run_store import Arrays, RunStore, canonical_text, solver_version, write_whole
from winding_study.sweep.spec import Value

OK = "ok"

# Exit code of a worker whose parent is gone.
ORPHANED = 3
SUFFIXES = (".csv", ".parquet", ".npz")
# Results that are one number, by column with its unit.
NUMBERS = {
    "stretch": "stretch",
    "stretch_closed_form": "stretch_closed_form",
    "span_stretch": "span_stretch",
    "energy_balance_pct": "energy_balance_pct",
    "kinetic_over_internal": "kinetic_over_internal",
    "cpu_seconds": "cpu_s",
}
PER_MARKER = {"theta": "theta_rad", "z": "z_m", "s": "s_m"}
PER_TURN = {"cable_per_turn": "cable_per_turn_m", "pitch_per_turn": "pitch_per_turn_m"}
Columns = dict[str, NDArray[Any]]


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
            # The parent was killed: this process and its queue have no owner any more.
            os._exit(ORPHANED)
        found = store.load(key, _named_already) if store is not None else None
        if found is None:
            found = attempt(run)
            if store is not None:
                store.save(key, found)
        results.append((key, found))
    return results


def _named_already(sentence: str) -> None:
    """Report nothing: the process that asks looked the run up before and named the damage."""


def table_columns(
    numbers: Sequence[int],
    keys: Sequence[str],
    inputs: Sequence[Mapping[str, Value]],
    results: Mapping[str, Arrays],
    *,
    solver: str,
) -> Columns:
    """Return the columns of a table, one row per run, NaN where there is no number.

    Args:
        numbers: Place of each run in its sweep, from 1.
        keys: Key of each run.
        inputs: Every input of each run by column name.
        results: Results by key, as of `attempt`.
        solver: Version of the solver.

    Returns:
        Columns of shape (runs,); those of PER_TURN have shape (runs, most turns of a run).
    """
    rows = [results[key] for key in keys]
    columns: Columns = {"run": np.asarray(numbers, dtype=np.int64)}
    for name in inputs[0]:
        columns[name] = np.asarray([row[name] for row in inputs])
    columns["status"] = np.asarray([str(row["status"]) for row in rows])
    for name, column in NUMBERS.items():
        columns[column] = np.asarray([float(row.get(name, np.nan)) for row in rows])
    per_marker = {name: _padded(rows, name) for name in PER_MARKER}
    for n in range(per_marker["s"].shape[1]):
        columns[f"p{n + 1}_wound"] = np.isfinite(per_marker["s"][:, n])
        for name, column in PER_MARKER.items():
            columns[f"p{n + 1}_{column}"] = per_marker[name][:, n]
    columns["turns"] = np.asarray(
        [row["cable_per_turn"].size if "cable_per_turn" in row else 0 for row in rows],
        dtype=np.int64,
    )
    for name, column in PER_TURN.items():
        columns[column] = _padded(rows, name)
    columns["solver"] = np.full(len(rows), solver)
    columns["key"] = np.asarray(keys)
    return columns


def _padded(rows: Sequence[Arrays], name: str) -> NDArray[np.float64]:
    lists = [row.get(name, np.empty(0)) for row in rows]
    padded = np.full((len(lists), max(one.size for one in lists)), np.nan)
    for row, one in zip(padded, lists, strict=True):
        row[: one.size] = one
    return padded


def write_table(path: Path, columns: Columns) -> None:
    """Write a table as CSV, Parquet or npz, by the file's suffix; one that exists is replaced.

    In Parquet, NaN is null and what belongs to turns is a list of its own length. In CSV, NaN is
    empty and what belongs to turns has a column for each turn, from 1.

    Raises:
        ValueError: The suffix is another.
        OSError: The file cannot be written.
    """
    if path.suffix == ".npz":
        # Typed as if a column could be named like NumPy's own option allow_pickle.
        write_whole(path, lambda file: np.savez_compressed(file, **columns))  # type: ignore[arg-type]
    elif path.suffix == ".parquet":
        write_whole(path, functools.partial(_write_parquet, columns))
    elif path.suffix == ".csv":
        write_whole(path, functools.partial(_write_csv, columns))
    else:
        raise ValueError(f"table must end in {', '.join(SUFFIXES)}, got {path.name}")


def _write_csv(columns: Columns, file: Any) -> None:
    flat: dict[str, list[Any]] = {}
    for name, column in columns.items():
        if column.ndim == 2:
            flat |= {f"{name}_{n}": part for n, part in enumerate(column.T.tolist(), start=1)}
        else:
            flat[name] = column.tolist()
    text = io.TextIOWrapper(file, encoding="utf-8", newline="")
    writer = csv.writer(text)
    writer.writerow(flat)
    for row in zip(*flat.values(), strict=True):
        writer.writerow(
            "" if isinstance(value, float) and np.isnan(value) else value for value in row
        )
    text.detach()


def _write_parquet(columns: Columns, file: Any) -> None:
    # Only who wants Parquet waits for it to load.
    import pyarrow as pa  # type: ignore[import-untyped]  # noqa: PLC0415
    import pyarrow.parquet as pq  # type: ignore[import-untyped]  # noqa: PLC0415

    arrays = {}
    for name, column in columns.items():
        if column.ndim == 2:
            arrays[name] = pa.array(
                [row[np.isfinite(row)] for row in column], type=pa.list_(pa.float64())
            )
        elif column.dtype.kind == "f":
            arrays[name] = pa.array(column, mask=np.isnan(column))
        elif column.dtype.kind == "U":
            arrays[name] = pa.array(column.tolist(), type=pa.string())
        else:
            arrays[name] = pa.array(column)
    pq.write_table(pa.table(arrays), file)
