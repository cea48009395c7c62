"""`winding plan`: what it writes, how it ends, how it refuses."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from winding_cli.app import app

RUNNER = CliRunner()
HELIX = ["--case", "4", "--pitch-mm", "18", "--turns", "3"]


def plan(*words: str) -> tuple[int, str]:
    done = RUNNER.invoke(app, ["plan", *words])
    return done.exit_code, done.output


@pytest.mark.slow
def test_a_plan_is_printed_drawn_and_written(tmp_path: Path) -> None:
    files = {kind: tmp_path / f"plan.{kind}" for kind in ("json", "csv", "png")}
    options = ["--json", str(files["json"]), "--csv", str(files["csv"])]
    code, output = plan(
        *HELIX, "--markers-every-turn", "--no-solver", *options, "--picture", str(files["png"])
    )
    assert code == 0
    assert "P3" in output
    assert files["png"].read_bytes().startswith(b"\x89PNG")
    record = json.loads(files["json"].read_text(encoding="utf-8"))
    assert record["missed"] == ""
    assert len(record["turns"]) == 3
    with files["csv"].open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert float(rows[-1]["cylinder_rad"]) == pytest.approx(6.0 * np.pi)
    assert float(rows[1]["t_s"]) == 0.01


@pytest.mark.slow
def test_the_solver_lies_where_it_is_planned(tmp_path: Path) -> None:
    file = tmp_path / "plan.json"
    code, _ = plan(*HELIX, "--markers-every-turn", "--json", str(file))
    assert code == 0
    record = json.loads(file.read_text(encoding="utf-8"))
    solver = record["solver"]
    # The bar of the issue, and 0.3 % of a turn, three times the most that was measured at markers.
    assert solver["residual_rms_m"] <= 0.05 * record["uncompensated_rms_m"]
    wanted = [item["wanted_rad"] for item in record["markers"]]
    pairs = zip(wanted, solver["markers_rad"], strict=True)
    both = [pair for pair in pairs if None not in pair]
    assert len(both) >= 3
    for angle, landed in both:
        assert landed == pytest.approx(angle, abs=0.003 * 2.0 * np.pi)


@pytest.mark.slow
def test_a_plan_names_the_markers_that_control_cannot_land(tmp_path: Path) -> None:
    file = tmp_path / "plan.json"
    code, output = plan(*HELIX, "--markers-every-turn", "--no-solver", "--json", str(file))
    assert code == 0
    items = json.loads(file.read_text(encoding="utf-8"))["under_control"]
    assert [item["id"] for item in items] == [1, 2, 3]
    # Whole turns need nearly the largest pull in case 4, and that from the first turn on.
    for item in items:
        off = abs(item["expected_rad"] - item["wanted_rad"]) + 2.0 * item["sigma_rad"]
        named = f"under control P{item['id']} lands" in output
        assert named == (off > (0.02 if item["id"] == 1 else 0.01) * 2.0 * np.pi)


def test_no_landings_are_planned_under_a_dead_weight(tmp_path: Path) -> None:
    file = tmp_path / "plan.json"
    options = ("--markers-every-turn", "--no-solver", "--no-brake", "--json", str(file))
    code, output = plan(*HELIX, *options)
    assert code == 0
    assert "under control" not in output
    assert json.loads(file.read_text(encoding="utf-8"))["under_control"] == []


def test_a_tolerance_that_is_not_kept_ends_with_one(tmp_path: Path) -> None:
    file = tmp_path / "two.yaml"
    file.write_text(
        "segments: [reverse_at: {z_mm: [0, 40], pitch_mm: 18, turns: 3}]", encoding="utf-8"
    )
    options = ["--case", "4", "--no-solver", "--tolerance-mm", "0.5"]
    code, output = plan(str(file), *options)
    assert code == 1
    assert "the tolerance is 0.5 mm" in output
    code, output = plan(str(file), *options, "--slow-down")
    assert code == 0
    assert "the cylinder is slowed" in output


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--case", "4"], "say once what is wanted"),
        ([*HELIX, "--even"], "say once what is wanted"),
        (["--even"], "say what to wind"),
        (["--case", "4", "nothing.csv"], "cannot read nothing.csv"),
        (["--case", "4", "nothing.csv", "--turns", "2"], "a file has its own"),
        (["--case", "4", "--pitch-mm", "2"], "turns would overlap"),
        ([*HELIX, "--carriage-travel-mm", "-10,30"], "the carriage travels from -10 to 30 mm"),
        ([*HELIX, "--carriage-travel-mm", "10,30"], "must hold 0 mm"),
        ([*HELIX, "--brake-limits-n", "3,2"], "must exceed its smallest, got 3 to 2 N"),
        ([*HELIX, "--carriage-speed-limit-mm-s", "0"], "must be positive, got 0"),
        ([*HELIX, "--tolerance-mm", "-1"], "--tolerance-mm must be positive"),
        ([*HELIX, "--slow-down"], "--slow-down needs --tolerance-mm"),
        ([*HELIX, "--start", "later"], "--start must be first or together"),
        ([*HELIX, "--picture", "plan.gif"], "--picture ends in .png"),
        ([*HELIX, "--period-ms", "0"], "--period-ms must lie in 1 to 1000"),
        ([*HELIX, "--element", "solid"], "wound with the rod"),
        (["--case", "4", "--pitch-mm", "18", "--turns", "nan"], "turns must lie above 0"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(words: list[str], sentence: str) -> None:
    code, output = plan(*words)
    assert code == 2
    assert sentence in output
    assert len(output.strip().splitlines()) == 1
