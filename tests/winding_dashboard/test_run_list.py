"""The list of runs: newest first, with verdict and report, and nothing else of the disk."""

import json
import os
from pathlib import Path
from typing import Any

import pytest
from simulated_page import Desk

from winding_dashboard.page.run_list import RunList

REPORT = "<html>the report</html>"


def written(folder: Path, *, when: float, report: bool = True, **changes: Any) -> None:
    """Write a run's numbers, as `winding_reports.records.run_record` does, and its report."""
    folder.mkdir(parents=True, exist_ok=True)
    content = {
        "identity": {"date": "2026-11-23 15:00:00 +0000"},
        "case": 4,
        # What else a file has of it is no outcome.
        "error_verdict": {"good": True, "sentence": "good: largest error 1.20 %"},
        "outcome": {"verdict": "good", "sentences": ["completed: 4.20 of 4.20 turns"]},
        **changes,
    }
    numbers = folder / "run.json"
    numbers.write_text(json.dumps(content), encoding="utf-8")
    os.utime(numbers, (when, when))
    if report:
        (folder / "report").mkdir()
        (folder / "report" / "index.html").write_text(REPORT, encoding="utf-8")


def test_newest_run_comes_first_with_its_own_report(tmp_path: Path) -> None:
    written(tmp_path, when=100.0)
    written(tmp_path / "run-2", when=200.0, case=0)
    listed = RunList(tmp_path).runs()
    assert [run.report for run in listed] == ["run-2/report/index.html", "report/index.html"]
    assert [run.condition for run in listed] == ["own condition", "case 4"]


def test_sessions_of_other_days_are_listed_with_all_their_runs(tmp_path: Path) -> None:
    written(tmp_path / "monday", when=100.0)
    written(tmp_path / "monday" / "run-2", when=200.0)
    assert [run.report for run in RunList(tmp_path).runs()] == [
        "monday/run-2/report/index.html",
        "monday/report/index.html",
    ]


@pytest.mark.parametrize(
    ("verdict", "style"),
    [
        ("good", "kept"), ("not good", "broken"), ("failed", "broken"), ("incomplete", "open"),
        ("not judged", "open"),
    ],
)  # fmt: skip
def test_list_prints_a_record_in_its_colour(tmp_path: Path, verdict: str, style: str) -> None:
    record = {"verdict": verdict, "sentences": ["ended by supervision", "12 frames lost"]}
    written(tmp_path, when=100.0, outcome=record)
    (run,) = RunList(tmp_path).runs()
    assert run.outcome.style == style
    assert run.outcome.word == verdict.upper()
    assert run.outcome.remark == "ended by supervision; 12 frames lost"


def test_runs_that_differ_by_weight_are_told_apart(tmp_path: Path) -> None:
    for number, weight in enumerate((2.5, 7.25), start=1):
        values = {"tension_n": weight, "cylinder_diameter_mm": 50.0, "cable_diameter_mm": 3.0}
        condition = {name: {"value": value} for name, value in values.items()}
        written(tmp_path / f"run-{number}", when=number, case=0, identity={"condition": condition})
    assert [run.condition for run in RunList(tmp_path).runs()] == [
        "own condition: 7.25 N, cylinder 50, cable 3 mm",
        "own condition: 2.50 N, cylinder 50, cable 3 mm",
    ]


def test_report_that_comes_later_is_found(tmp_path: Path) -> None:
    written(tmp_path, when=100.0, report=False)
    runs = RunList(tmp_path)
    assert runs.runs()[0].report == ""
    (tmp_path / "report").mkdir()
    (tmp_path / "report" / "index.html").write_text(REPORT, encoding="utf-8")
    assert runs.runs()[0].report == "report/index.html"


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"outcome": 3}', "{"])
def test_file_that_is_no_run_is_named_and_harms_nothing(tmp_path: Path, content: str) -> None:
    (tmp_path / "run.json").write_text(content, encoding="utf-8")
    (run,) = RunList(tmp_path).runs()
    assert run.date == "run.json"
    assert run.outcome.remark.startswith("cannot be read")


def test_page_lists_runs_and_serves_their_reports(tmp_path: Path) -> None:
    written(tmp_path, when=100.0)
    desk = Desk(runs=tmp_path)
    seen = desk.look()
    assert not seen["hidden"]["runs-card"]
    assert 'href="runs/report/index.html"' in seen["parts"]["runs"]
    assert desk.request("GET", "/runs/report/index.html").text == REPORT


@pytest.mark.parametrize(
    "path",
    ["run.json", "../secret", "report/../run.json", "/etc/passwd", "report/", "%2e%2e/secret"],
)
def test_nothing_but_reports_is_served(tmp_path: Path, path: str) -> None:
    folder = tmp_path / "runs"
    written(folder, when=100.0)
    (tmp_path / "secret").write_text("secret", encoding="utf-8")
    assert Desk(runs=folder).request("GET", f"/runs/{path}").status_code == 404


def test_page_without_a_folder_has_no_list() -> None:
    assert Desk().look()["hidden"]["runs-card"]
