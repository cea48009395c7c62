"""The index over runs: what is listed as what, and that it can be lost."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from run_folders import numbers, write_run

from winding_reports.runs.run_index import INDEX, RunIndex, RunIndexError, Selection
from winding_reports.runs.run_row import run_row
from winding_reports.runs.trend import announcements, trend_json, trends


def no_outcome(content: dict[str, Any]) -> None:
    del content["outcome"]


def lost_frames(content: dict[str, Any]) -> None:
    content["outcome"]["losses"] = ["12 of 4001 messages of rig/image are missing"]


def unjudged(content: dict[str, Any]) -> None:
    content["error_verdict"]["good"] = None


def not_complete(content: dict[str, Any]) -> None:
    content["outcome"]["complete"] = False


def off_the_lay(content: dict[str, Any]) -> None:
    content["outcome"]["verdict"] = "not good"
    content["verdict"] = {"kept": False, "sentence": "the lay does not keep 0.5 mm"}


def unknown_verdict(content: dict[str, Any]) -> None:
    content["outcome"]["verdict"] = "splendid"


@pytest.mark.parametrize(
    ("change", "verdict", "reason"),
    [
        (no_outcome, "unreadable", "states no outcome"),
        (unknown_verdict, "unreadable", "states no outcome"),
        (lost_frames, "unhealthy", "12 of 4001"),
        (unjudged, "not judged", "largest error"),
        (not_complete, "incomplete", "completed: 5.40 turns"),
        (off_the_lay, "not good", "lay: the lay does not keep"),
    ],
)
def test_a_doubtful_run_is_listed_with_its_reason_and_is_not_good(
    change: Callable[[dict[str, Any]], None], verdict: str, reason: str
) -> None:
    content = numbers(1)
    assert run_row("a", content).good == 1
    change(content)
    row = run_row("a", content)
    assert (row.verdict, row.good) == (verdict, 0)
    assert reason in row.reason


def test_numbers_that_are_none_end_in_nothing_known() -> None:
    content = numbers(1)
    content["markers"] = [None, {"s_fem_m": "x"}]
    content["error_verdict"]["largest_error_pct"] = float("nan")
    content["material"] = {"young_pa": 3.1e6, "refused": "P3 is missed by 7 %"}
    content["identity"]["labels"] = ["hose"]
    row = run_row("a", content)
    assert (row.error_pct, row.young_pa, row.length_error_pct) == (None, None, None)
    assert row.cable == "4 mm"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for number in range(6):
        write_run(tmp_path / f"{number}", numbers(number, batch="a" if number < 3 else "b"))
    write_run(tmp_path / "left" / "5-copy", numbers(5))
    write_run(tmp_path / "5" / "run-2", numbers(6, verdict="not good", error_pct=6.0))
    (tmp_path / "killed" / "log").mkdir(parents=True)
    (tmp_path / "5" / "report").mkdir()
    (tmp_path / "5" / "report" / "run.json").write_text("{}", encoding="utf-8")
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "run.json").write_text('{"identity": ', encoding="utf-8")
    return tmp_path


def answers(folder: Path) -> tuple[Any, ...]:
    with RunIndex(folder) as index:
        rows = index.rows()
        return rows, index.counts(), trend_json(trends(rows), len(rows))


def test_every_run_is_listed_once_and_copies_as_such(folder: Path) -> None:
    rows, counts, _ = answers(folder)
    assert counts == {
        "broken off": 1, "good": 6, "not good": 1, "twin": 1, "unreadable": 1
    }  # fmt: skip
    found = {row.path: row for row in rows}
    assert found["left/5-copy"].reason == "a copy of 5"
    assert found["killed"].reason.startswith("there is no run.json")
    assert found["broken"].reason == "run.json is no JSON"
    assert [row.path for row in rows[-2:]] == ["left/5-copy", "5/run-2"]
    with RunIndex(folder) as index:
        assert len(index.rows(Selection(batch="b", verdict="good"))) == 3
        assert len(index.rows(Selection(since="2026-01-05T10", until="2026-01-05T11"))) == 3
        assert index.run("run-00005").path == "5"
        with pytest.raises(RunIndexError, match="several runs begin with run-"):
            index.run("run-")
        with pytest.raises(RunIndexError, match="has no run x"):
            index.run("x")


@pytest.mark.parametrize("damage", [None, b"", b"SQLite format 3\0 and then nothing of it"])
def test_a_lost_or_damaged_index_is_rebuilt_alike(folder: Path, damage: bytes | None) -> None:
    before = answers(folder)
    (folder / INDEX).unlink()
    if damage is not None:
        (folder / INDEX).write_bytes(damage)
    assert answers(folder) == before
    assert (folder / INDEX).is_file()


def test_the_index_follows_what_changes(folder: Path) -> None:
    answers(folder)
    content = numbers(2, verdict="failed", remark="brake slipped")
    (folder / "2" / "run.json").write_text(json.dumps(content), encoding="utf-8")
    (folder / "5" / "run.json").unlink()
    write_run(folder / "new", numbers(9))
    rows, counts, _ = answers(folder)
    found = {row.path: row for row in rows}
    assert counts["failed"] == 1
    assert found["new"].good == 1
    # The copy is the run now.
    assert found["left/5-copy"].good == 1
    assert found["5"].verdict == "broken off"
    with RunIndex(folder) as index:
        assert [row.path for row in index.rows(Selection(remark="SLIPPED"))] == ["2"]


def test_a_drift_is_announced_before_its_limit_and_of_its_own_series_alone() -> None:
    scatter = np.random.default_rng(9).standard_normal((2, 50))
    rows = []
    for number in range(50):
        grown = 0.02 * max(0, number - 20) / 30.0
        for machine, share, noise in (("left", grown, scatter[0]), ("right", 0.0, scatter[1])):
            young = 3.1e6 * (1.0 + share + 0.002 * noise[number])
            error = 2.0 + 40.0 * share + 0.05 * noise[number]
            content = numbers(2 * number, young, error_pct=error, machine=machine)
            rows.append(run_row(f"{machine}{number}", content))
    found = trends(rows)
    drifting = [trend for trend in found if trend.chart.drifts]
    assert {trend.rows[0].machine for trend in drifting} == {"left"}
    first = {trend.quantity.name: trend.chart.drifts[0] for trend in drifting}
    assert 20 < first["young_pa"].at < 40
    assert any("modulus of hose on left drifts up" in text for text in announcements(found))
    (error,) = (trend for trend in drifting if trend.quantity.name == "error_pct")
    drift = error.chart.drifts[0]
    assert max(error.chart.values[: drift.at + 1]) < 4.8
    assert "at this pace its limit of 4.8 % is reached in about" in error.sentence(drift)


def test_what_is_not_healthy_is_not_charted() -> None:
    rows = [run_row(f"{n}", numbers(n, verdict="failed", young=1.0e6)) for n in range(9)]
    assert trends(rows) == []
