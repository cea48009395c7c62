"""Runs of a sweep: their keys, their results, their table, who winds them."""

from __future__ import annotations

import os
import signal
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import psutil
import pyarrow.parquet as pq
import pytest

from cable_fem_node.winding.prediction import PlannedRun
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.cable.cases import Case, paper_case
from winding_core.machine.drive import DriveProfile, TurningDrive
from winding_study.run_store import Arrays, RunStore, run_key, solver_version
from winding_study.sweep.engines import (
    Certificates,
    DaskEngine,
    Engine,
    EngineError,
    JoblibEngine,
    Shard,
    batches,
    refuse_open_scheduler,
    stored_results,
    wind_missing,
)
from winding_study.sweep.outcome import (
    OK,
    SolverMismatchError,
    attempt,
    table_columns,
    wind_batch,
    write_table,
)

pytestmark = [pytest.mark.campaign, pytest.mark.slow]

# P1 and P2 come to lie within the second that the tests wind, P3 and P4 do not.
CASE: Case = replace(paper_case(4), number=0, marker_spacing=4.0e-3)


def run(friction: float = 0.1, **more: object) -> PlannedRun:
    given: dict[str, object] = {"duration": 1.0} | more
    return PlannedRun(config=WindingConfig(case=CASE, friction=friction), **given)  # type: ignore[arg-type]


def runs(count: int, **more: object) -> dict[str, PlannedRun]:
    planned = [run(friction, **more) for friction in np.linspace(0.05, 0.3, count).tolist()]
    return {key_of(one): one for one in planned}


def jerked() -> PlannedRun:
    """A cylinder that turns back at 100 rad/s within 50 ms: the ledger is open by 3 %."""
    drive = TurningDrive(angular_speed=100.0, feed_speed=0.4, ramp_time=0.05, unwinds_from=1.5)
    return run(drive=drive, duration=2.9)


def key_of(planned: PlannedRun) -> str:
    return run_key(planned, solver_version())


class KillsItsWorker(PlannedRun):
    """A run that ends its process, as the kernel does when memory is short."""

    def wind(self, progress: object = None) -> None:  # type: ignore[override]
        os.kill(os.getpid(), signal.SIGKILL)


def quiet(_: object) -> None:
    """Hear what a test does not ask for."""


def test_a_key_follows_all_that_decides_a_run() -> None:
    keys = {
        key_of(one)
        for one in (
            run(),
            run(0.2),
            run(duration=2.0),
            run(element="solid"),
            run(drive=DriveProfile(angular_speed=2.0)),
            replace(run(), config=replace(run().config, law="neo_hookean")),
        )
    }
    assert len(keys) == 6
    assert key_of(run()) in keys


def test_a_run_that_cannot_be_wound_is_refused_while_it_is_planned() -> None:
    with pytest.raises(ValueError, match="duration must be positive"):
        run(duration=0.0)
    with pytest.raises(ValueError, match="element must be rod or solid"):
        run(element="shell")
    # Two turns, of which the second would lie on the first.
    with pytest.raises(ValueError, match="turns of the solid pass through each other"):
        run(drive=DriveProfile(feed_speed=1.0e-4), duration=8.0, element="solid")


def test_results_are_those_of_the_prediction() -> None:
    found, prediction = attempt(run()), run().wind()
    assert str(found["status"]) == OK
    assert found["s"][:2].tolist() == prediction.markers["s"][1:3].tolist()
    assert found["theta"][:2].tolist() == prediction.markers["theta"][1:3].tolist()
    assert float(found["stretch"]) == prediction.stretch
    assert float(found["energy_balance_pct"]) == prediction.energy.balance_pct


def test_a_worker_with_another_solver_is_refused() -> None:
    with pytest.raises(SolverMismatchError, match="install the same version on both"):
        wind_batch([], None, "another", None)


def test_a_worker_takes_what_a_killed_one_has_stored(tmp_path: Path) -> None:
    store = RunStore(tmp_path)
    store.save(key_of(run()), {"status": OK, "s": [7.0]})
    ((key, found),) = wind_batch([(key_of(run()), run())], store, solver_version(), None)
    assert (key, found["s"].tolist()) == (key_of(run()), [7.0])


def test_many_runs_go_in_large_batches_and_few_one_by_one() -> None:
    def sizes(count: int, element: str = "rod") -> list[int]:
        given = {str(n): run(element=element) for n in range(count)}
        return [len(batch) for batch in batches(given, workers=2)]

    assert sizes(5) == [1] * 5
    assert sizes(200) == [20] * 10
    assert sizes(85) == [10] * 8 + [5]
    assert sizes(80, "solid") == [1] * 80


def test_shards_are_disjoint_and_complete() -> None:
    for count in [1, 3, 7]:
        keys = [f"{n % 10}" for n in range(25)]
        parts = [Shard(number=k, count=count).keys(keys) for k in range(1, count + 1)]
        assert sorted(key for part in parts for key in part) == sorted(set(keys))
        assert parts == [Shard.parse(f"{k}/{count}").keys(keys) for k in range(1, count + 1)]


def test_a_shard_that_is_none_is_refused() -> None:
    for text in ["0/3", "4/3", "3", "a/b", "1/0", "-1/3", "1/3/5"]:
        with pytest.raises(ValueError, match="shard must be k/N with k from 1 to N"):
            Shard.parse(text)


def table(given: dict[str, PlannedRun], results: dict[str, Arrays]) -> Arrays:
    keys: Sequence[str] = list(given)
    inputs = [{"friction": one.config.friction, "law": one.config.law} for one in given.values()]
    return table_columns(range(1, len(keys) + 1), keys, inputs, results, solver="v1")


def test_the_table_is_the_same_in_both_formats(tmp_path: Path) -> None:
    given = runs(2) | {key_of(jerked()): jerked()}
    # Eight seconds are two turns, and all markers.
    long = run(duration=8.0)
    given[key_of(long)] = long
    columns = table(given, {key: attempt(one) for key, one in given.items()})
    for name in ("table.npz", "table.parquet"):
        write_table(tmp_path / name, columns)
    with np.load(tmp_path / "table.npz", allow_pickle=False) as file:
        dense = {name: file[name] for name in file.files}
    parquet = pq.read_table(tmp_path / "table.parquet")
    assert list(dense) == parquet.column_names == list(columns)
    assert dense["status"][:2].tolist() == [OK, OK]
    assert dense["status"][2].startswith("energy balance open by")
    assert dense["p2_wound"].tolist() == [True, True, False, True]
    assert dense["p3_wound"].tolist() == [False, False, False, True]
    assert dense["turns"].tolist() == [0, 0, 0, 2]
    for name, column in dense.items():
        other = parquet[name].to_pylist()
        if column.ndim == 2:
            assert [row[np.isfinite(row)].tolist() for row in column] == other
        elif column.dtype.kind == "f":
            assert [None if np.isnan(value) else value for value in column] == other
        else:
            assert column.tolist() == other


def test_no_other_format_is_written(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"table must end in .*\.npz.*, got t\.ods"):
        write_table(tmp_path / "t.ods", {})


@pytest.mark.parametrize("engine", [JoblibEngine(processes=1), DaskEngine(processes=2)])
def test_engines_give_the_same_table(tmp_path: Path, engine: Engine) -> None:
    given = runs(6)
    expected = table(given, {key: attempt(one) for key, one in given.items()})
    ended: list[Arrays] = []
    store = RunStore(tmp_path)
    results = wind_missing(given, {}, engine=engine, store=store, ended=ended.append)
    assert len(ended) == 6
    for found in (results, stored_results(store, list(given), quiet)):
        made = table(given, found)
        for name in expected.keys() - {"cpu_s"}:
            np.testing.assert_array_equal(made[name], expected[name])


def test_only_what_is_missing_is_wound(tmp_path: Path) -> None:
    given = runs(4)
    first, *others = given
    done = {first: attempt(given[first])}
    ended: list[Arrays] = []
    engine = JoblibEngine(processes=1)
    store = RunStore(tmp_path)
    results = wind_missing(given, done, engine=engine, store=store, ended=ended.append)
    assert list(results) == list(given)
    assert len(ended) == 3
    assert set(stored_results(store, list(given), quiet)) == set(others)


def test_a_killed_process_loses_nothing(tmp_path: Path) -> None:
    given = runs(48, duration=2.0)
    winding = JoblibEngine(processes=2).wind(given, RunStore(tmp_path))
    found = dict([next(winding)])
    workers = [
        child
        for child in psutil.Process().children(recursive=True)
        if any("LokyProcess" in word for word in child.cmdline())
    ]
    workers[0].kill()
    assert len(stored_results(RunStore(tmp_path), list(given), quiet)) < 48
    found.update(winding)
    assert set(found) == set(given)
    assert {str(results["status"]) for results in found.values()} == {OK}


# Eight workers of a cluster start one after the other, on a busy computer half a minute each.
@pytest.mark.timeout(900)
@pytest.mark.parametrize(
    ("engine", "sentence"),
    [
        (JoblibEngine(processes=2), r"killed 3 times in a row.*; 1 runs are missing"),
        (DaskEngine(processes=2), "1 runs ended their worker again and again"),
    ],
)
def test_a_run_that_kills_its_process_ends_no_other(tmp_path, engine, sentence) -> None:
    poison = KillsItsWorker(config=WindingConfig(case=CASE), duration=1.5)
    given = runs(4) | {key_of(poison): poison}
    with pytest.raises(EngineError, match=sentence):
        dict(engine.wind(given, RunStore(tmp_path)))
    assert len(stored_results(RunStore(tmp_path), list(given), quiet)) == 4


def test_a_scheduler_that_others_can_speak_to_is_refused() -> None:
    for address, sentence in [
        ("tcp://10.0.0.7:8786", "is not encrypted: dask sends pickled code"),
        ("10.0.0.7:8786", "is not encrypted"),
        ("tcp://localhost.example.org:8786", "is not encrypted"),
        ("tcp://127.0.0.1.example.org:8786", "is not encrypted"),
        ("tls://10.0.0.7:8786", "needs --tls-ca, --tls-cert and --tls-key"),
        ("ws://127.0.0.1:8786", "must be a tls:// address"),
        ("tls://10.0.0.7", "must look like tls://host:8786"),
        ("", "must look like tls://host:8786"),
    ]:
        with pytest.raises(ValueError, match=sentence):
            refuse_open_scheduler(address, None)


def test_a_scheduler_of_this_machine_may_be_plain() -> None:
    for address in ["tcp://127.0.0.1:8786", "localhost:1", "tcp://[::1]:8786"]:
        refuse_open_scheduler(address, None)


def test_missing_certificates_are_named(tmp_path: Path) -> None:
    missing = tmp_path / "ca.pem"
    with pytest.raises(ValueError, match=r"there is no certificate file .*ca\.pem"):
        Certificates(authority=missing, certificate=missing, key=missing)
