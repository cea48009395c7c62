"""`winding runs`: tables, page and JSON over a folder of runs."""

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from in_process import keeps_schema, schema, winding
from run_folders import numbers, write_run
from typer.testing import Result


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with forty runs of one cable; its modulus grows by 2 % in the last thirty."""
    folder = tmp_path_factory.mktemp("cell") / "runs"
    scatter = np.random.default_rng(4).standard_normal(40)
    for number, noise in enumerate(scatter):
        young = 3.1e6 * (1.0 + 0.002 * noise + 0.02 * max(0, number - 9) / 30.0)
        write_run(folder / f"{number:02d}", numbers(number, young, operator="ann"))
    write_run(folder / "40", numbers(40, verdict="incomplete", remark="cable ran out"))
    return folder


def runs(folder: Path, *words: object, code: int = 0) -> Result:
    return winding(folder.parent, "runs", *words, code=code)


def written(folder: Path, name: str, *words: object) -> Any:
    return keeps_schema(name, runs(folder, *words, "--json", "-").stdout)


def test_made_up_numbers_keep_the_schema_of_a_run() -> None:
    assert list(schema("run", "winding_reports").iter_errors(numbers(3))) == []


def test_runs_are_listed_with_their_reasons(folder: Path, tmp_path: Path) -> None:
    content = written(folder, "runs", "list")
    assert content["counts"] == {"good": 40, "incomplete": 1}
    assert content["runs"][-1]["reason"] == "ended by a signal after 2 turns"
    assert len(written(folder, "runs", "list", "--remark", "RAN")["runs"]) == 1
    table, parquet = tmp_path / "t.csv", tmp_path / "t.parquet"
    done = runs(folder, "list", "runs", "--newest", 3, "--output", table, "--output", parquet)
    assert "41 runs: 40 good, 1 incomplete; the newest 3 are shown" in done.stdout
    assert "cable ran out" in done.stdout
    rows = list(csv.DictReader(table.open(encoding="utf-8")))
    found = pq.read_table(parquet).to_pylist()
    assert [row["path"] for row in rows] == [row["path"] for row in found]
    assert found[0]["young_pa"] == content["runs"][0]["young_pa"]


def test_a_drift_is_said_drawn_and_tabulated(folder: Path, tmp_path: Path) -> None:
    content = written(folder, "runs_trend", "trend")
    (young,) = (item for item in content["trends"] if item["quantity"] == "young_pa")
    first = young["drifts"][0]
    assert first["direction"] == "up"
    # Ten stable runs, then the drift.
    assert 10 < first["run"] < 30
    page, table = tmp_path / "trend.html", tmp_path / "trend.csv"
    done = runs(folder, "trend", "runs", "--output", page, "--output", table)
    assert first["sentence"] in done.stdout
    html = page.read_text(encoding="utf-8")
    assert first["sentence"][1:] in html
    assert html.count("<img") == 3
    points = [row for row in csv.DictReader(table.open("r")) if row["quantity"] == "young_pa"]
    assert len(points) == 40
    announced = [int(row["run"]) for row in points if row["announced"] == "1"]
    assert announced == [item["run"] for item in young["drifts"]]


def test_two_runs_stand_side_by_side(folder: Path, tmp_path: Path) -> None:
    other = write_run(tmp_path / "other", numbers(90, 2.9e6, young_stated_mpa=2.0))
    content = written(folder, "runs_compare", "compare", "run-00000", other)
    rows = {row["name"]: row for row in content["rows"]}
    assert (rows["young_mpa"]["first"], rows["young_mpa"]["second"]) == (3.0, 2.0)
    assert "cylinder_diameter_mm" not in rows
    young = rows["young_pa"]
    assert young["difference"] == pytest.approx(young["second"] - young["first"])
    assert written(folder, "runs", "show", "runs/40")["runs"][0]["verdict"] == "incomplete"


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("list", "nowhere"), "there is no folder of runs nowhere"),
        (("list", "--verdict", "fine"), "--verdict must be one of good, "),
        (("list", "--output", "t.txt"), "--output must end in one of .csv .parquet .json"),
        (("show", "run-9"), "runs has no run run-9"),
        (("compare", "runs/00", "run-9"), "runs has no run run-9"),
        (("compare", "runs/00", "broken.json"), "broken.json is no JSON"),
        (("trend", "--since", "yesterday"), "--since must begin like 2026-11-05, got 'yesterday'"),
    ],
)
def test_wrong_input_is_one_sentence(folder: Path, words: tuple[str, ...], sentence: str) -> None:
    (folder.parent / "broken.json").write_text("{", encoding="utf-8")
    done = runs(folder, *words, code=2)
    assert done.stdout == ""
    assert done.stderr.startswith(f"winding: {sentence}")
    assert done.stderr.count("\n") == 1
