"""`winding commission`: what is refused, the plan, and one real run that leaves a cell."""

import json
from pathlib import Path
from typing import Any

import pytest
from in_process import winding

from processes import PATIENCE
from winding_core.catalogue.cables import read_cable
from winding_core.run_spec import RunSpec

OF_CASE = ("commission", "--case", 4, "--law", "neo_hookean")


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--travel-mm", 5, "--plan"), "the limits allow no motion of 2 turns"),
        (("--longest-s", 90, "--plan"), "at most 60 s, got 90 s"),
        (("--pull-limits-n", 5, 2, "--plan"), "pulls must ascend"),
        (("--feed-mm-s", 4), "--feed-mm-s is not for a commissioning run"),
        (("--tension-share", 0.8), "--tension-share is not for a commissioning run"),
        (("--element", "solid"), "not the element solid"),
        (("--name", "../x"), "a cable's name is of letters"),
        (("--cell-file", "there.yaml"), "there.yaml exists already"),
        (("--cable-file", "there.yaml"), "there.yaml exists already"),
        (("--prior-load-share", "0.9,0.5"), "load_share must ascend"),
        (("--output", "kept", "--duration-s", 3), "--duration-s is not for a commissioning run"),
        (("--output", "kept"), "kept exists already"),
    ],
)
def test_bad_options_are_refused(tmp_path: Path, words: tuple[object, ...], sentence: str) -> None:
    (tmp_path / "there.yaml").write_text("mine", encoding="utf-8")
    (tmp_path / "kept").mkdir()
    before = sorted(tmp_path.rglob("*"))
    assert sentence in winding(tmp_path, *OF_CASE, *words, code=2).stderr
    assert sorted(tmp_path.rglob("*")) == before
    assert (tmp_path / "there.yaml").read_text(encoding="utf-8") == "mine"


def test_a_plan_moves_and_writes_nothing(tmp_path: Path) -> None:
    assert "chosen: " in winding(tmp_path, *OF_CASE, "--plan", code=0).stdout
    assert not list(tmp_path.iterdir())


def test_without_a_brake_the_weight_pulls(tmp_path: Path) -> None:
    words = ("--machine", "external", "--plan")
    assert "pull 3.92 N throughout" in winding(tmp_path, *OF_CASE, *words, code=0).stdout


@pytest.mark.campaign
@pytest.mark.processes
def test_a_real_run_leaves_a_cell_and_a_cable(command: Any, tmp_path: Path) -> None:
    words = (*OF_CASE, "--speed", 0, "--output", "run", "--truth", "truth.json", "--name", "hose")
    command(*words, cwd=tmp_path, patience=4.0 * PATIENCE, code=0)
    run = tmp_path / "run"
    found = json.loads((run / "commissioning.json").read_bytes())
    hidden = json.loads((tmp_path / "truth.json").read_bytes())["hidden"]
    numbers = found["numbers"]
    assert read_cable(run / "hose.yaml").uncertainty["young_mpa"] > 0.0
    text = (run / "found-cell.yaml").read_text(encoding="utf-8")
    spec = RunSpec.from_cell(None, {"case": 4, "cable": str(run / "hose.yaml")})
    assert spec.condition.law == "mooney_rivlin"
    assert "90 % intervals" in text
    # The rod's lag is not that of the simulated machine: 1 to 7 % were seen.
    assert numbers["free_length"]["mean"] == pytest.approx(hidden["free_length"], rel=0.1)
    # Modulus and rig of the simulated machine, within four deviations.
    truth = {
        "young_per_share": 2.6e6 / hidden["load_share"],
        "drag_per_share": hidden["drag"] / hidden["load_share"],
    }
    for name, value in truth.items():
        assert abs(value - numbers[name]["mean"]) < 4.0 * numbers[name]["deviation"], name
