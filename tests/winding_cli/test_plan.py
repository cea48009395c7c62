"""`winding plan`: what it writes, how it ends, how it refuses."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from arm_example import EXAMPLE
from typer.testing import CliRunner

from winding_cli.app import app

HELIX = ["--case", "4", "--pitch-mm", "18", "--turns", "3"]
# The guide of this motion goes further than the arm of the example.
FAR = ["--case", "4", "--even", "--duration-s", "100", "--no-solver"]


DRUM = ["--case", "4", "--drum-width-mm", "60", "--flange-mm", "20"]


def plan(*words: str, code: int = 0) -> str:
    """Return what a command prints that ends with a code."""
    done = CliRunner().invoke(app, ["plan", *words])
    assert done.exit_code == code, done.output
    return done.output


@pytest.mark.slow
def test_a_plan_is_printed_drawn_and_written(tmp_path: Path) -> None:
    files = {kind: tmp_path / f"plan.{kind}" for kind in ("json", "csv", "png")}
    options = ["--json", str(files["json"]), "--csv", str(files["csv"])]
    output = plan(
        *HELIX, "--markers-every-turn", "--no-solver", *options, "--picture", str(files["png"])
    )
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
    plan(*HELIX, "--markers-every-turn", "--json", str(file))
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
    output = plan(*HELIX, "--markers-every-turn", "--no-solver", "--json", str(file))
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
    assert "under control" not in plan(*HELIX, *options)
    assert json.loads(file.read_text(encoding="utf-8"))["under_control"] == []


def test_a_tolerance_that_is_not_kept_ends_with_one(tmp_path: Path) -> None:
    file = tmp_path / "two.yaml"
    file.write_text(
        "segments: [reverse_at: {z_mm: [0, 40], pitch_mm: 18, turns: 3}]", encoding="utf-8"
    )
    options = ["--case", "4", "--no-solver", "--tolerance-mm", "0.5"]
    assert "the tolerance is 0.5 mm" in plan(str(file), *options, code=1)
    assert "the cylinder is slowed" in plan(str(file), *options, "--slow-down")


def test_a_drum_is_filled_at_one_speed_of_the_cable_under_a_falling_pull(tmp_path: Path) -> None:
    record_file, table = tmp_path / "drum.json", tmp_path / "drum.csv"
    winding = ["--winding", "parallel", "--layers", "3", "--layer-pull-share", "0.9"]
    files = ["--output", str(record_file), "--output", str(table)]
    output = plan(*DRUM, *winding, "--cable-speed-mm-s", "40", *files)
    assert "3 parallel layers at a pitch of 4 mm" in output
    drum = json.loads(record_file.read_text(encoding="utf-8"))["drum"]
    layers = drum["layers"]
    rho = np.array([row["radius_m"] for row in layers])
    speed = np.array([row["cylinder_speed_rad_s"] for row in layers])
    pull = np.array([row["pull_n"] for row in layers])
    # The stretched cable is thinner than the one that layers are counted with, by less than this.
    assert rho * speed == pytest.approx(0.04, rel=0.02)
    assert pull / pull[0] == pytest.approx([1.0, 0.9, 0.81])
    length = 14.0 * np.hypot(2.0 * np.pi * rho, 4.0e-3) + np.pi * rho * [1.0, 1.0, 0.0]
    assert [row["length_m"] for row in layers] == pytest.approx(length.tolist())
    assert drum["length_m"] > drum["undeformed_length_m"] > 0.8 * drum["length_m"]
    assert drum["filled_diameter_m"] == pytest.approx(0.030 + 8.0e-3 * (1.0 + np.sqrt(3.0)))
    with table.open(encoding="utf-8") as file:
        rows = [{name: float(cell) for name, cell in row.items()} for row in csv.DictReader(file)]
    assert rows[-1]["cylinder_rad"] / (2.0 * np.pi) == pytest.approx(drum["turns"])
    for row in layers:
        middle = np.pi * (row["first_turn"] + row["last_turn"])
        at = next(k for k, item in enumerate(rows) if item["cylinder_rad"] > middle)
        turned = rows[at + 50]["cylinder_rad"] - rows[at]["cylinder_rad"]
        assert turned / 0.5 == pytest.approx(row["cylinder_speed_rad_s"], rel=1e-6)
        assert rows[at]["tension_n"] == pytest.approx(row["pull_n"], abs=1e-5)


@pytest.mark.slow
def test_the_rod_winds_a_drum_in_layers(tmp_path: Path) -> None:
    record_file = tmp_path / "drum.json"
    short = ["--case", "4", "--drum-width-mm", "24", "--flange-mm", "20", "--layers", "2"]
    plan(*short, "--solver", "--json", str(record_file))
    solver = json.loads(record_file.read_text(encoding="utf-8"))["solver"]
    # Half a diameter is a valley missed.
    assert solver["residual_rms_m"] < 2.0e-3


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
        ([*FAR, "--machine-file", str(EXAMPLE)], "the guide would go to 0.531 m, beyond its"),
        ([*HELIX, "--start", "later"], "--start must be first or together"),
        ([*HELIX, "--picture", "plan.gif"], "--picture ends in .png"),
        ([*HELIX, "--period-ms", "0"], "--period-ms must lie in 1 to 1000"),
        ([*HELIX, "--element", "solid"], "wound with the rod"),
        (["--case", "4", "--pitch-mm", "18", "--turns", "nan"], "turns must lie above 0"),
        (["--case", "4", "--layers", "2"], "a drum needs --drum-width-mm and --flange-mm"),
        (["--case", "4", "--drum-width-mm", "60"], "--flange-mm is missing"),
        ([*DRUM], "say once how much goes on the drum"),
        ([*DRUM, "--layers", "9"], "9 layers would pass the flanges, 20 mm high: they hold 5"),
        ([*DRUM, "--length-m", "90"], "90 m of cable would pass the flanges"),
        ([*DRUM, "--layers", "2", "--even"], "a drum has a program of its own"),
        ([*DRUM, "--even", "--turns", "4"], "leave the drum after 3.102 turns"),
        ([*DRUM, "--layers", "2", "--edge-dwell-turns", "0.2"], "orthocyclic winding has no --ed"),
        ([*DRUM, "--layers", "2", "--pitch-mm", "7"], "no wider than 1.7 diameters, 6.8 mm"),
        ([*DRUM, "--layers", "2", "--winding", "wild"], "must be one of orthocyclic, parallel, cr"),
        ([*DRUM, "--layers", "2", "--no-brake", "--layer-pull-share", "0.9"], "layer 2 would be p"),
        ([*DRUM, "--layers", "2", "--carriage-travel-mm", "-9,50"], "the carriage travels from -9"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(words: list[str], sentence: str) -> None:
    output = plan(*words, code=2)
    assert sentence in output
    assert len(output.strip().splitlines()) == 1
