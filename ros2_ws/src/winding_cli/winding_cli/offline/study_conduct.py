"""Conducting a study: winding with progress and resumption, then training."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from winding_cli.terminal.console import busy
from winding_cli.terminal.refusal import FAILED, evidence, refuse, refused
from winding_cli.terminal.termination import end, interruptible

if TYPE_CHECKING:
    from winding_study.paper.case_result import CaseResult
    from winding_study.paper.study import StudyConfig
    from winding_study.paper.study_record import StudyRecord

# A file of the store that is unfinished for so long belongs to a killed process [s].
ABANDONED = 600.0


def conduct(
    config: StudyConfig | None,
    cases: tuple[int, ...],
    *,
    store: Path,
    processes: int,
    seeds: tuple[int, ...],
    steps: int | None,
) -> tuple[StudyRecord, int]:
    """Return what a study found, and how many of its cases the store had.

    Args:
        config: What to wind; None takes the paper's simulation as the base.
        cases: Rows of Table 1.
        store: Folder of finished runs.
        processes: Cases at a time.
        seeds: Of the models that start at random; none trains nothing.
        steps: Training steps of a network; None takes the usual number.
    """
    from winding_study.paper.findings import beside_experiment, study_record

    results: tuple[CaseResult, ...] = ()
    stored = 0
    if config is not None:
        results, stored = _wind(config, cases, store, processes)
    with refused(ValueError, code=FAILED):
        comparison = beside_experiment(config, cases, results)
    try:
        with interruptible(), busy("learning") as show:
            tables = evidence("correction")
            if tables is None:
                _say(
                    "winding_verification is not installed: no tables of evidence on the correction"
                )
            record = study_record(
                config,
                cases,
                results,
                comparison,
                seeds=seeds,
                steps=steps,
                evidence=tables,
                progress=lambda text: show(description=text),
            )
    except KeyboardInterrupt:
        end("interrupted while the models were trained; what is wound is kept")
    return record, stored


def _wind(
    config: StudyConfig, cases: tuple[int, ...], folder: Path, processes: int
) -> tuple[tuple[CaseResult, ...], int]:
    from rich.progress import TimeRemainingColumn

    from winding_study.paper.study import CaseFailedError, wind_cases
    from winding_study.run_store import RunStore

    store, there = RunStore(folder), 0
    keys = _keys(config, cases)
    present = sum(store.path(key).exists() for key in keys)
    if present:
        _say(f"{present} of {len(cases)} cases are in {folder} already and are not wound again")
    shares: dict[int, float] = {}
    try:
        with (
            interruptible(),
            busy("winding", TimeRemainingColumn(), total=float(len(cases))) as show,
        ):
            folder.mkdir(parents=True, exist_ok=True)
            store.remove_unfinished(before=time.time() - ABANDONED)

            def share(number: int, done: float) -> None:
                shares[number] = done
                running = ", ".join(
                    f"{n} {100.0 * part:.0f} %" for n, part in sorted(shares.items()) if part < 1.0
                )
                show(completed=there + sum(shares.values()), description=f"case {running}")

            def resumed(result: CaseResult) -> None:
                nonlocal there
                there += 1
                show(completed=there)

            def wound(result: CaseResult) -> None:
                _say(f"case {result.case} wound: {result.cpu_seconds:.1f} CPU seconds")

            results = wind_cases(
                config, wound, cases, processes, store, resumed=resumed, share=share, say=_say
            )
            return results, there
    except KeyboardInterrupt:
        kept = sum(store.path(key).exists() for key in keys)
        end(
            f"interrupted: {kept} of {len(cases)} cases are in {folder}; the same command goes on "
            "from there"
        )
    except CaseFailedError as error:
        refuse(f"{error}; the other cases are in {folder}", FAILED)
    except OSError as error:
        refuse(f"cannot write to {folder}: {error.strerror or error}; give another --store", FAILED)


def _keys(config: StudyConfig, cases: tuple[int, ...]) -> list[str]:
    """Return the keys of all cases, so that what cannot be wound is refused before any is."""
    keys = []
    for number in cases:
        try:
            keys.append(config.key(number))
        except ValueError as error:
            refuse(f"case {number}: {error}")
    return keys


def _say(sentence: str) -> None:
    print(sentence, file=sys.stderr, flush=True)
