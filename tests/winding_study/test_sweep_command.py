"""`winding sweep` as people run it: tables, refusals, shards, kills and a real cluster."""

import inspect
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import psutil
import pytest
from started import PATIENCE, start, wait_for
from typer.testing import CliRunner

from winding_cli.app import app
from winding_cli.commands.predict import predict
from winding_core.parameters import option_kinds
from winding_study.run_parameters import RunParameters
from winding_study.run_store import Arrays

pytestmark = [pytest.mark.campaign, pytest.mark.slow]

# P1 to P3 come to lie within the second.
SHORT = """
parameters:
  case: 4
  marker_spacing_mm: 4
  duration_s: 1
  friction: {from: 0.05, to: 0.3, count: 8}
"""
# A second or two of work for two processes, so that a kill comes in the middle.
LONG = SHORT.replace("duration_s: 1", "duration_s: 2.5").replace("count: 8", "count: 60")


@pytest.fixture
def spec(tmp_path: Path) -> Path:
    path = tmp_path / "spec.yaml"
    path.write_text(SHORT, encoding="utf-8")
    return path


def sweep(*arguments: object, code: int = 0) -> str:
    """Return all that a command prints that ends with a code, in this process."""
    result = CliRunner().invoke(app, ["sweep", *map(str, arguments)])
    assert result.exception is None or isinstance(result.exception, SystemExit)
    assert result.exit_code == code, result.output
    return result.output


def read(path: Path) -> Arrays:
    with np.load(path, allow_pickle=False) as file:
        return {name: file[name] for name in file.files}


def same(one: Arrays, other: Arrays) -> bool:
    """Whether two tables agree but for the processor time."""
    return list(one) == list(other) and all(
        np.array_equal(one[name], other[name], equal_nan=one[name].dtype.kind == "f")
        for name in one
        if name != "cpu_s"
    )


def finished(store: Path) -> dict[Path, tuple[int, int]]:
    """Return each finished run's file with its inode and time of writing [ns]."""
    return {path: (path.stat().st_ino, path.stat().st_mtime_ns) for path in store.glob("??/*.npz")}


def test_every_option_of_predict_can_be_swept_and_no_other() -> None:
    # What is made of a run, and whether it is repeated, is not what is wound.
    aside = {"json_file", "csv_file", "vtk_file", "output", "force", "pictures", "check"}
    aside |= {"richardson", "cell", "cable", "library"}
    options = set(inspect.signature(predict).parameters)
    assert aside <= options
    kinds = option_kinds(RunParameters)
    assert options - aside == set(kinds)
    assert {"case", "tension_mpa", "rolling", "law", "duration_s"} <= options
    assert set(kinds.values()) == {bool, int, float, str}


def test_nothing_is_left_open_in_a_row() -> None:
    typed = {"case": 4, "tension_mpa": 0.5}
    given = RunParameters.from_typed(typed)
    row = given.as_typed(typed)
    assert (row["cylinder_diameter_mm"], row["cable_diameter_mm"]) == (30.0, 4.0)
    # 0.5 MPa on a round section of 4 mm.
    assert row["tension_n"] == pytest.approx(0.5 * np.pi * 4.0, rel=1e-11)
    # The span of 198 mm stands across the centreline radius of 17 mm.
    assert row["guide_distance_mm"] == pytest.approx(np.hypot(198.0, 17.0), rel=1e-11)
    names = ("young_mpa", "poisson", "density", "mass_scaling")
    assert [row[name] for name in names] == [2.6, 0.47, 1337.0, 1.0]
    open_in_first = ("tension_n", "guide_distance_mm")
    again = RunParameters.from_typed({"case": 4} | {name: row[name] for name in open_in_first})
    assert again.plan().config.free_length == pytest.approx(given.plan().config.free_length)


def test_a_sweep_makes_a_table_and_does_it_once(tmp_path: Path, spec: Path) -> None:
    store, out = tmp_path / "store", tmp_path / "table.npz"
    output = sweep(spec, "--store", store, "--output", out, "--processes", 1)
    assert "8 runs ok, 0 failed" in output
    first, files = read(out), finished(store)
    assert first["friction"] == pytest.approx(np.linspace(0.05, 0.3, 8))
    assert first["run"].tolist() == list(range(1, 9))
    assert first["p2_wound"].all()
    again = (spec, "--store", store, "--output", out, "--processes", 1)
    there = f"winding: --output: {out} exists already; --force replaces it\n"
    assert sweep(*again, code=2) == there
    output = sweep(*again, "--force")
    assert f"8 of them are in {store} already" in output
    assert f"wrote {out}: 8 rows" in output
    assert finished(store) == files
    assert same(read(out), first)
    assert (read(out)["cpu_s"] == first["cpu_s"]).all()


def test_cables_and_cells_are_swept_by_name(tmp_path: Path) -> None:
    cells = []
    for name, case in (("left", 4), ("right", 9)):
        cells.append(tmp_path / f"{name}.yaml")
        cells[-1].write_text(f"condition: {{case: {case}}}\n", encoding="utf-8")
    path, out = tmp_path / "spec.yaml", tmp_path / "table.npz"
    path.write_text(
        f"parameters: {{cell: [{cells[0]}, {cells[1]}], cable: [hose, tube], duration_s: 1, "
        "cylinder_diameter_mm: 250, tension_n: 25}\n",
        encoding="utf-8",
    )
    output = sweep(path, "--store", tmp_path / "store", "--output", out, "--processes", 1)
    table = read(out)
    assert table["cell"].tolist() == [str(cell) for cell in cells for _ in range(2)]
    assert table["cable"].tolist() == ["hose", "tube"] * 2
    assert table["cable_diameter_mm"].tolist() == [12.0, 6.0] * 2
    # Case 9 has another marker spacing than case 4: what is not the cable's is the cell's.
    spacing = table["marker_spacing_mm"].tolist()
    assert spacing[0] == spacing[1] != spacing[2] == spacing[3]
    path.write_text("parameters: {cable: [hose, hse], duration_s: 1}\n", encoding="utf-8")
    sentence = "run 2 of 2 (cable hse): the library has no cable 'hse'; did you mean hose?"
    output = sweep(path, "--store", tmp_path / "store", code=2)
    assert output == f"winding: {path}: {sentence}\n"


def test_a_damaged_run_is_named_and_wound_again(tmp_path: Path, spec: Path) -> None:
    store, out = tmp_path / "store", tmp_path / "table.npz"
    sweep(spec, "--store", store, "--output", out, "--processes", 1)
    first = read(out)
    victim = sorted(finished(store))[3]
    victim.write_bytes(victim.read_bytes()[:100])
    output = sweep(spec, "--store", store, "--output", out, "--processes", 1, "--force")
    assert f"{victim} is damaged and counts as missing" in output
    assert f"7 of them are in {store} already" in output
    assert same(read(out), first)


def test_a_failed_run_is_a_row(tmp_path: Path, spec: Path) -> None:
    # A cylinder that turns back at 100 rad/s within 50 ms: the ledger is open by 3 %.
    spec.write_text(
        "{combine: zip, parameters: {case: 4, duration_s: 2.9, marker_spacing_mm: 4,"
        " unwind_from_s: 1.5, ramp_time_s: [0.5, 0.05], omega_rad_s: [1.74, 100],"
        " feed_mm_s: [5, 400]}}"
    )
    out = tmp_path / "table.npz"
    output = sweep(spec, "--store", tmp_path / "store", "--output", out, "--processes", 1)
    assert "1 runs ok, 1 failed" in output
    status = read(out)["status"]
    assert status[0] == "ok"
    assert status[1].startswith("energy balance open by")
    assert np.isfinite(read(out)["p1_s_m"]).tolist() == [True, False]


def test_shards_make_the_same_table_together(tmp_path: Path, spec: Path) -> None:
    whole, out = tmp_path / "whole.npz", tmp_path / "table.npz"
    sweep(spec, "--store", tmp_path / "one", "--output", whole, "--processes", 1)
    store = tmp_path / "parts"
    seen: list[int] = []
    for k in (1, 2, 3):
        output = sweep(spec, "--store", store, "--collect", "--output", out, code=1)
        assert f"runs are not in {store} yet" in output
        assert not out.exists()
        part = tmp_path / f"part{k}.npz"
        output = sweep(
            spec, "--store", store, "--shard", f"{k}/3", "--output", part, "--processes", 1
        )
        assert "already" not in output
        seen += read(part)["run"].tolist()
    assert sorted(seen) == list(range(1, 9))
    sweep(spec, "--store", store, "--collect", "--output", out)
    assert same(read(out), read(whole))


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("parameters: {case: 4, frictoin: 0.1}", "no parameter frictoin; did you mean friction?"),
        ("parameters: {case: 4, friction: [0.1, -0.2]}", "run 2 of 2 (friction -0.2): friction"),
        ("parameters: {case: [4, 13]}", "run 2 of 2 (case 13): case must be one of 1 to 12"),
        ("parameters: {case: 4, law: [linear, soft]}", "run 2 of 2 (law soft): law must be one of"),
        ("parameters: {case: 4, element: shell}", "run 1 of 1: element must be one of rod, solid"),
        ("parameters: {case: 4, duration_s: 0}", "run 1 of 1: duration_s must be positive"),
        ("parameters: {case: 4, mass_scaling: 0}", "mass_scaling must be positive"),
        (
            "parameters: {case: 4, element: solid, duration_s: 8, feed_mm_s: [5, 0.1]}",
            "(feed_mm_s 0.1): the cable's width over the least distance of two turns",
        ),
        ("parameters: {friction: 0.1}", "run 1 of 1: say what to wind: case 1 to 12"),
        ("parameters: {case: 4, tension_n: 1, tension_mpa: 1}", "give the tension once"),
        ("parameters: [case]", "must hold a mapping named parameters"),
    ],
)
def test_a_bad_description_is_refused(tmp_path: Path, spec: Path, text: str, sentence: str) -> None:
    spec.write_text(text, encoding="utf-8")
    output = sweep(spec, "--store", tmp_path / "store", code=2)
    assert sentence in output
    assert output.count("\n") == 1
    assert not (tmp_path / "store").exists()


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--output", "table.xls"], "--output must end in .csv, .parquet, .npz, got table.xls"),
        (["--output", "nowhere/table.npz"], "there is no folder nowhere for table.npz"),
        (["--shard", "5/4"], "shard must be k/N with k from 1 to N, got 5/4"),
        (["--shard", "9/9"], "shard 9/9 is empty: there are 8 runs"),
        (["--engine", "slurm"], "engine must be joblib or dask, got 'slurm'"),
        (["--scheduler", "tls://far:1"], "--scheduler belongs to --engine dask"),
        (["--engine", "dask", "--tls-ca", "a.pem"], "belong to a --scheduler"),
        (["--engine", "dask", "--scheduler", "tcp://far:8786"], "is not encrypted: dask sends"),
        (
            ["--engine", "dask", "--scheduler", "tls://far:1", "--tls-ca", "a.pem"],
            "give --tls-ca, --tls-cert and --tls-key together",
        ),
    ],
)
def test_a_bad_option_is_refused_in_one_sentence(
    tmp_path: Path, spec: Path, arguments: list[str], sentence: str
) -> None:
    output = sweep(spec, "--store", tmp_path / "store", *arguments, code=2)
    assert sentence in output
    assert output.count("\n") == 1
    assert not (tmp_path / "store").exists()


def test_a_description_that_is_not_there_is_named(tmp_path: Path) -> None:
    assert "none.yaml: No such file or directory" in sweep(tmp_path / "none.yaml", code=2)


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM])
def test_an_ended_sweep_is_continued(tmp_path: Path, spec: Path, how: signal.Signals) -> None:
    spec.write_text(LONG, encoding="utf-8")
    store, out = tmp_path / "store", tmp_path / "table.npz"
    process = start("sweep", spec, "--store", store, "--output", out)
    wait_for(lambda: len(finished(store)) >= 3, process)
    workers = psutil.Process(process.pid).children(recursive=True)
    process.send_signal(how)
    _, output = process.communicate(timeout=PATIENCE)
    if how == signal.SIGTERM:
        assert process.returncode == 130
        assert f"of 60 runs are in {store}; the same command goes on from there" in output
    else:
        assert process.returncode == -signal.SIGKILL
    # Workers whose parent is gone end after the run in hand, or after their idle time.
    assert not psutil.wait_procs(workers, timeout=PATIENCE)[1]
    kept = finished(store)
    assert 3 <= len(kept) < 60
    assert not out.exists()

    output = sweep(spec, "--store", store, "--output", out)
    assert f"{len(kept)} of them are in {store} already" in output
    after = finished(store)
    assert len(after) == 60
    assert kept.items() <= after.items()

    if how == signal.SIGKILL:
        other = tmp_path / "other.npz"
        sweep(spec, "--store", tmp_path / "other", "--output", other, "--processes", 1)
        assert same(read(out), read(other))


@pytest.fixture
def scheduler(tmp_path: Path) -> Iterator[tuple[str, list[str], list[int]]]:
    """A real scheduler with two workers behind TLS: address, options of the command, workers."""
    from distributed import LocalCluster, Security

    security = Security.temporary()
    options = []
    for option, text in (
        ("--tls-ca", security.tls_ca_file),
        ("--tls-cert", security.tls_client_cert),
        ("--tls-key", security.tls_client_key),
    ):
        path = tmp_path / f"{option[2:]}.pem"
        path.write_text(text, encoding="ascii")
        options += [option, str(path)]
    with LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        security=security,
        dashboard_address="127.0.0.1:0",
        silence_logs=50,
    ) as cluster:
        yield cluster.scheduler_address, options, [one.pid for one in cluster.workers.values()]


def test_a_cluster_behind_tls_loses_nothing_with_a_worker(
    tmp_path: Path, spec: Path, scheduler: tuple[str, list[str], list[int]]
) -> None:
    address, certificates, workers = scheduler
    assert address.startswith("tls://127.0.0.1:")
    spec.write_text(LONG, encoding="utf-8")
    store, out = tmp_path / "store", tmp_path / "table.npz"
    process = start(
        "sweep", spec, "--store", store, "--output", out, "--engine", "dask",
        "--scheduler", address, *certificates,
    )  # fmt: skip
    wait_for(lambda: len(finished(store)) >= 1, process)
    assert len(finished(store)) < 60
    os.kill(workers[0], signal.SIGKILL)
    _, output = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, output
    assert len(finished(store)) == 60
    assert set(read(out)["status"]) == {"ok"}
    assert read(out)["run"].tolist() == list(range(1, 61))
