"""`winding sweep`: many predictions at once, in one table, resumed where they stopped."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from cable_fem_node.winding.prediction import PlannedRun
from winding_cli.offline.wound_parameters import wound_parameters
from winding_cli.terminal.console import Shown, busy, record_table, result_console, six_digits
from winding_cli.terminal.output_path import Force, check_output_file, check_output_folder, staged
from winding_cli.terminal.refusal import FAILED, complain, need_extra, refuse, refused
from winding_cli.terminal.termination import end, interruptible
from winding_core.parameters import option_kinds
from winding_core.units import MILLIMETRE
from winding_study.run_parameters import RunParameters

if TYPE_CHECKING:
    from winding_study.run_store import Arrays, RunStore
    from winding_study.sweep.engines import Engine
    from winding_study.sweep.outcome import Columns
    from winding_study.sweep.spec import SweepSpec, Value

STORE = Path("runs") / "sweeps"
ENGINES = ("joblib", "dask")
# Parameters of a sweep that stand for many: a cell file, and a cable of the library.
FILES = ("cell", "cable")
# Rows of the table that is printed.
LONGEST = 24
_GO_ON = "the same command goes on from there"

ABANDONED = 3600.0  # An unfinished file this old has no living writer [s]


@dataclass(frozen=True, kw_only=True)
class Plan:
    """The runs of this call: places in the sweep, keys, inputs, and what to wind by key."""

    numbers: list[int]  # Place of each run in the whole sweep, from 1
    keys: list[str]  # Key of each run in the store
    inputs: list[dict[str, Value]]  # What was varied, by name
    runs: dict[str, PlannedRun]  # What to wind, by key


def sweep(
    spec: Annotated[Path, typer.Argument(help="YAML of what to vary, as in docs/tutorials.")],
    *,
    out: Annotated[
        Path | None,
        typer.Option(
            "--output", "--out", help="Table of all runs, .csv, .parquet or .npz by its ending."
        ),
    ] = None,
    store: Annotated[
        Path, typer.Option(help="Folder of finished runs; what is in it is not wound again.")
    ] = STORE,
    engine: Annotated[
        str, typer.Option(help="joblib: processes of this machine; dask: a cluster.")
    ] = "joblib",
    processes: Annotated[int, typer.Option(min=1, help="Of this machine.")] = 2,
    scheduler: Annotated[
        str | None,
        typer.Option(help="Address of a dask scheduler, tls://host:port; else one is started."),
    ] = None,
    tls_ca: Annotated[Path | None, typer.Option(help="Authority's certificate (PEM).")] = None,
    tls_cert: Annotated[Path | None, typer.Option(help="Own certificate (PEM).")] = None,
    tls_key: Annotated[Path | None, typer.Option(help="Own private key (PEM).")] = None,
    shard: Annotated[
        str | None, typer.Option(help="k/N: only the k-th of N disjoint parts, for job arrays.")
    ] = None,
    collect: Annotated[
        bool, typer.Option("--collect", help="Wind nothing: make the table of what is stored.")
    ] = False,
    force: Force = False,
) -> None:
    """Wind every combination of parameters that a file describes and tabulate the results."""
    from winding_study.run_store import RunStore, solver_version
    from winding_study.sweep.engines import Shard
    from winding_study.sweep.outcome import SUFFIXES, table_columns, write_table

    if out is not None and out.suffix not in SUFFIXES:
        refuse(f"--output must end in {', '.join(SUFFIXES)}, got {out.name}")
    if out is not None and out.suffix == ".parquet":
        need_extra("tables", f"--output {out.name}")
    check_output_file(out, "--output", force=force)
    check_output_folder(store, "--store")
    with refused(ValueError):
        part = Shard() if shard is None else Shard.parse(shard)
        winder = _engine(engine, processes, scheduler, (tls_ca, tls_cert, tls_key))
    varied, plan = _plan(spec, part)
    kept = RunStore(store)
    done = _stored(kept, plan, part)
    missing = len(plan.runs) - len(done)
    if collect and missing:
        refuse(f"{missing} of {len(plan.runs)} runs are not in {store} yet", FAILED)
    if missing:
        done = _wind(plan, done, winder, kept)
    columns = table_columns(plan.numbers, plan.keys, plan.inputs, done, solver=solver_version())
    print_summary(columns, varied)
    if out is not None:
        with staged(out) as place:
            write_table(place, columns)
        complain(f"wrote {out}: {len(plan.keys)} rows")


def _engine(
    name: str,
    processes: int,
    scheduler: str | None,
    tls: tuple[Path | None, Path | None, Path | None],
) -> Engine:
    from winding_study.sweep.engines import Certificates, DaskEngine, JoblibEngine

    if name not in ENGINES:
        raise ValueError(f"engine must be {' or '.join(ENGINES)}, got {name!r}")
    authority, certificate, key = tls
    if scheduler is None and any(path is not None for path in tls):
        raise ValueError("--tls-ca, --tls-cert and --tls-key belong to a --scheduler")
    if name == "joblib":
        if scheduler is not None:
            raise ValueError("--scheduler belongs to --engine dask")
        return JoblibEngine(processes=processes)
    if authority is not None and certificate is not None and key is not None:
        certificates = Certificates(authority=authority, certificate=certificate, key=key)
    elif any(path is not None for path in tls):
        raise ValueError("give --tls-ca, --tls-cert and --tls-key together")
    else:
        certificates = None
    return DaskEngine(processes=processes, address=scheduler, certificates=certificates)


def _plan(path: Path, part: Any) -> tuple[tuple[str, ...], Plan]:
    """Check every run of a sweep and return this part of it."""
    from winding_study.run_store import run_key, solver_version
    from winding_study.sweep.spec import SpecError, parse_spec

    try:
        spec = parse_spec(
            path.read_text(encoding="utf-8"),
            option_kinds(RunParameters) | dict.fromkeys(FILES, str),
        )
    except (OSError, UnicodeDecodeError) as error:
        refuse(f"cannot read {path}: {getattr(error, 'strerror', None) or error}")
    except SpecError as error:
        refuse(f"{path}: {error}")
    rows = []
    with busy("checking the runs", total=len(spec)) as show:
        for number, given in enumerate(spec, start=1):
            try:
                options = {key: value for key, value in given.items() if key not in FILES}
                named = {key: str(given[key]) for key in FILES if key in given}
                cell = Path(named["cell"]) if "cell" in named else None
                parameters = wound_parameters(options, cell=cell, cable=named.get("cable"))
                run = parameters.plan()
            except ValueError as error:
                refuse(f"{path}: {_name(spec, number, given)}: {error}")
            inputs = {**named, **parameters.as_typed(options)}
            rows.append((number, run_key(run, solver_version()), inputs, run))
            show(completed=number)
    wanted = set(part.keys([key for _, key, _, _ in rows]))
    if not wanted:
        refuse(f"{path}: shard {part.number}/{part.count} is empty: there are {len(rows)} runs")
    rows = [row for row in rows if row[1] in wanted]
    return spec.varied, Plan(
        numbers=[row[0] for row in rows],
        keys=[row[1] for row in rows],
        inputs=[row[2] for row in rows],
        runs={row[1]: row[3] for row in rows},
    )


def _name(spec: SweepSpec, number: int, given: dict[str, Value]) -> str:
    values = ", ".join(f"{name} {given[name]}" for name in spec.varied)
    return f"run {number} of {len(spec)}" + (f" ({values})" if values else "")


def _stored(store: RunStore, plan: Plan, part: Any) -> dict[str, Arrays]:
    from winding_study.sweep.engines import stored_results

    complain(
        f"{len(plan.runs)} runs"
        + (f" in shard {part.number}/{part.count}" if part.count > 1 else "")
    )
    if not store.folder.exists():
        return {}
    left = store.remove_unfinished(before=time.time() - ABANDONED)
    if left:
        complain(f"{left} files that killed processes left unfinished were removed")
    done = stored_results(store, plan.keys, complain)
    if done:
        complain(f"{len(done)} of them are in {store.folder} already")
    return done


def _wind(
    plan: Plan, done: dict[str, Arrays], engine: Engine, store: RunStore
) -> dict[str, Arrays]:
    from rich.progress import MofNCompleteColumn, TimeRemainingColumn

    from cable_fem_node.dynamics.compile import is_compiled
    from winding_study.sweep.engines import EngineError, wind_missing
    from winding_study.sweep.outcome import OK, SolverMismatchError

    if not is_compiled():
        # Processes that are started later find the machine code.
        with busy("compiling the solver's kernels"):
            next(iter(plan.runs.values())).model()
    finished = len(done)
    try:
        with (
            interruptible(),
            busy(
                "winding", MofNCompleteColumn(), TimeRemainingColumn(), total=len(plan.runs)
            ) as show,
        ):
            show(completed=finished)
            failed = sum(str(results["status"]) != OK for results in done.values())

            def ended(results: Arrays) -> None:
                nonlocal failed, finished
                finished += 1
                failed += str(results["status"]) != OK
                words = f"winding, {failed} failed" if failed else "winding"
                show(completed=finished, description=words)

            return wind_missing(plan.runs, done, engine=engine, store=store, ended=ended)
    except KeyboardInterrupt:
        end(f"interrupted: {_kept(plan, store)}; {_GO_ON}")
    except EngineError as error:
        refuse(f"{error}; {_kept(plan, store)}; {_GO_ON}", FAILED)
    except SolverMismatchError as error:
        refuse(error, FAILED)
    except OSError as error:
        refuse(f"cannot write to {store.folder}: {error.strerror or error}", FAILED)


def _kept(plan: Plan, store: RunStore) -> str:
    count = sum(store.path(key).exists() for key in plan.runs)
    return f"{count} of {len(plan.runs)} runs are in {store.folder}"


def print_summary(columns: Columns, varied: tuple[str, ...]) -> None:
    """Print the first rows of a sweep's table and how many runs failed.

    Args:
        columns: The whole table.
        varied: Inputs with more than one value; the others are not shown.
    """
    console = result_console()
    rows = columns["run"].size
    lengths = [name for name in columns if name.startswith("p") and name.endswith("_s_m")]

    def of(name: str) -> Callable[[int], Any]:
        return lambda row: columns[name][row]

    def worded(name: str) -> Callable[[int], str]:
        return lambda row: six_digits(columns[name][row])

    def used(row: int) -> float:
        per_turn = columns["cable_per_turn_m"][row]
        return float(np.nanmean(per_turn)) if np.isfinite(per_turn).any() else np.nan

    shown = (
        Shown("run", of("run")),
        *(Shown(name, worded(name)) for name in varied),
        *(Shown(f"S{name.split('_')[0][1:]}, mm", of(name), ".2f", MILLIMETRE) for name in lengths),
        Shown("stretch", of("stretch"), ".5f"),
        Shown("cable a turn, mm", used, ".2f", MILLIMETRE),
        Shown("balance, %", of("energy_balance_pct"), ".2g"),
        Shown("status", lambda row: str(columns["status"][row])),
    )
    title = f"{rows} runs" + (f", the first {LONGEST}" if rows > LONGEST else "")
    console.print(record_table(shown, range(min(rows, LONGEST)), title=title))
    failed = int((columns["status"] != "ok").sum())
    console.print(
        f"{rows - failed} runs ok, {failed} failed; "
        f"{np.nansum(columns['cpu_s']):.1f} CPU seconds of winding"
    )
