"""What all commands have in common: exit codes, JSON on stdout, progress, nothing written over."""

import json
import time
from pathlib import Path
from typing import Any

import pytest
from in_process import winding

from winding_cli.app import COMMANDS, _installed
from winding_cli.terminal import console
from winding_cli.terminal.console import busy

TENSILE = "strain,stress_mpa\n0.02,0.052\n0.05,0.128\n0.1,0.25\n0.15,0.37\n0.2,0.48\n0.3,0.69\n"
SWEEP = "parameters: {case: 9, duration_s: 2}\n"
PREDICT = "predict --case 9 --duration-s 2"
PLAN = "plan --case 9 --even --turns 2 --no-solver"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "tensile.csv").write_text(TENSILE, encoding="utf-8")
    (tmp_path / "sweep.yaml").write_text(SWEEP, encoding="utf-8")
    (tmp_path / "pictures").mkdir()
    (tmp_path / "pictures" / "one.png").touch()
    return tmp_path


# Words -> what the refusal names; none of them starts anything.
REFUSED = {
    "run --case 14": "--case",
    "serve --output tensile.csv": "tensile.csv is not a folder",
    "predict --case 14": "--case",
    "plan --case 9": "say once what is wanted",
    "sweep nowhere.yaml": "nowhere.yaml",
    "identify nowhere.csv --case 9": "nowhere.csv does not exist",
    "commission --case 4 --travel-mm 5 --plan": "the limits allow no motion of 2 turns",
    "study --cases 14": "rows 1 to 12",
    "train --model oracle": "--model",
    "render film --fps 0": "--fps",
    "track nowhere --output markers.csv": "nowhere does not exist",
    "board board.png --columns 2": "--columns",
    "calibrate pictures/none --output camera.yaml": "none",
    "play-film nowhere": "nowhere does not exist",
    "play-film pictures --fps 5": "there is no camera: give --camera",
    "play-film pictures --compressed gif": "--compressed must be one of jpeg, png, got 'gif'",
    "check-film pictures --fps 5": "one.png is not a picture",
    "conform --domain 999": "999",
    "doctor --domain 999": "999",
    "dashboard --runs nowhere": "nowhere is no folder",
    "health no_node": "no_node",
    "graph --urdf --case 14": "case",
    "bag info nowhere": "nowhere",
    "cable show nowhere": "nowhere",
    "runs list nowhere": "nowhere",
    "bag check nowhere": "nowhere",
    "verify B99": "B99",
    "faults --only nothing_of_that_name": "nothing_of_that_name",
}
# What was computed, and is not in order.
NOT_GOOD = {
    f"{PLAN} --start together --tolerance-mm 0.03": "the tolerance is 0.03 mm",
    "sweep sweep.yaml --collect --store empty": "runs are not in empty yet",
}


def test_every_command_is_tried() -> None:
    tried = {words.split()[0] for words in REFUSED}
    assert tried >= {*COMMANDS, *_installed()} - {"cell"}


@pytest.mark.parametrize(
    ("words", "code", "sentence"),
    [
        *((words, 2, sentence) for words, sentence in REFUSED.items()),
        *((words, 1, sentence) for words, sentence in NOT_GOOD.items()),
    ],
)
def test_code_tells_refused_from_bad(folder: Path, words: str, code: int, sentence: str) -> None:
    before = sorted(folder.rglob("*"))
    done = winding(folder, *words.split(), code=code)
    assert sentence in done.stderr
    assert "Traceback" not in done.output
    assert sorted(folder.rglob("*")) == before


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "key"),
    [
        (PREDICT, "markers"),
        (PLAN, "missed"),
        ("identify --tensile tensile.csv", "laws"),
        ("study --cases 9 --fem published --no-models", "cells"),
        ("verify B01", None),
        ("doctor", "checks"),
    ],
)
def test_json_goes_to_stdout_alone(folder: Path, words: str, key: str | None) -> None:
    done = winding(folder, *f"{words} --json -".split())
    content = json.loads(done.stdout)
    assert (content[0] if key is None else content[key]) is not None
    # What people read went the other way.
    assert len(done.stderr.splitlines()) > 2
    assert not (folder / "-").exists()


def test_a_file_that_is_no_json_does_not_go_to_stdout(folder: Path) -> None:
    done = winding(folder, *f"{PREDICT} --csv -".split())
    assert (done.exit_code, done.stdout) == (2, "")
    assert "--csv: - is for --json" in done.stderr


# Words of a command -> what it would write, there already.
WRITTEN = {
    f"{PREDICT} --json": "p.json",
    f"{PREDICT} --csv": "p.csv",
    f"{PREDICT} --output": "q.pvd",
    f"{PREDICT} --vtk new.pvd --csv": "r.csv",
    f"{PLAN} --output": "plan.svg",
    "identify --tensile tensile.csv --json": "i.json",
    "study --fem published --no-models --json": "s.json",
    "study --lengths": "lengths.csv",
    "study --fem published --no-models --output": "page/",
    "sweep sweep.yaml --output": "table.csv",
    "train --model rig --output": "weights/",
    "track pictures --case 9 --output": "markers.csv",
    "track pictures --case 9 --output new.csv --lay": "lay.csv",
    "render": "film/",
    "board": "board.png",
    "calibrate pictures --output": "camera.yaml",
    "doctor --json": "d.json",
    "verify B01 --json": "v.json",
    "faults --json": "f.json",
}


@pytest.mark.parametrize(("words", "name"), WRITTEN.items())
def test_nothing_is_written_over_unless_it_is_forced(folder: Path, words: str, name: str) -> None:
    file = folder / name / "mine" if name.endswith("/") else folder / name
    file.parent.mkdir(exist_ok=True)
    file.write_text("mine", encoding="utf-8")
    done = winding(folder, *f"{words} {name}".split(), code=2)
    assert "already; --force replaces it" in done.stderr
    assert file.read_text(encoding="utf-8") == "mine"


@pytest.mark.slow
def test_outputs_are_of_the_kind_that_their_names_end_with(folder: Path) -> None:
    done = winding(folder, *f"{PREDICT} --output p.txt".split(), code=2)
    assert "--output must end in one of .json .csv .pvd, got p.txt" in done.stderr
    done = winding(folder, *f"{PREDICT} --json p.json --output q.json".split())
    assert "two files for .json, p.json and q.json" in done.stderr
    (folder / "p.csv").write_text("mine", encoding="utf-8")
    winding(folder, *f"{PREDICT} --output p.json --output p.csv --force".split(), code=0)
    assert json.loads((folder / "p.json").read_text())["case"] == 9
    assert (folder / "p.csv").read_text().startswith("t_s,")


def test_a_log_shows_how_far_long_work_is(monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    monkeypatch.setattr(console, "FIRST_LINE", 0.02)
    seen = ""
    end = time.monotonic() + 60.0
    with busy("counting", total=4.0) as show:
        for completed in (1.0, 3.0):
            show(completed=completed)
            while f"winding: counting, {25 * completed:.0f} %, 0 s" not in seen:
                assert time.monotonic() < end
                seen += capsys.readouterr().err
    assert seen.count("\n") < 20


def test_what_ends_soon_prints_nothing(capsys: Any) -> None:
    with busy("counting"):
        pass
    assert capsys.readouterr() == ("", "")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (PREDICT, "winding with the rod"),
        ("verify W04", "verifying W04"),
        ("study --fem published --steps 20 --seeds 1", "scored"),
        ("train --compare --steps 2", "scored"),
        ("render film --fps 20 --duration-s 1", "drawing frames"),
    ],
)
def test_commands_that_take_long_show_where_they_are(
    folder: Path, words: str, sentence: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(console, "FIRST_LINE", 0.01)
    monkeypatch.setattr(console, "LONGEST_SILENCE", 0.01)
    done = winding(folder, *words.split(), code=0)
    shown = [line for line in done.stderr.splitlines() if line.startswith("winding: ")]
    assert any(sentence in line and line.endswith(" s") for line in shown), done.stderr
