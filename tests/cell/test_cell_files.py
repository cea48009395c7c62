"""Cell files: the same run as from options or a goal; a wrong one is refused with its line."""

import contextlib
import json
import random
import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from in_process import winding
from jsonschema import Draft202012Validator
from mutations import VALID, Wrong, all_of_them, of_values

from winding_cli.commands.cell import schema, template
from winding_cli.run.configuration import configured
from winding_cli.terminal.record_options import spelled
from winding_core.parameters import ParameterError
from winding_core.run_spec import GOAL_OPTIONS, OPTIONS, USUAL, RunSpec

WRONG = all_of_them()
CHECKED = ["cell", "check"]
CHECK = Draft202012Validator(schema())
FLAT = {key: value for keys in yaml.safe_load(VALID).values() for key, value in keys.items()}


def words_of(values: dict[str, Any]) -> list[str]:
    """Return options as they are typed."""
    words = []
    for key, value in values.items():
        if isinstance(value, bool):
            words.append(spelled(key) if value else spelled(f"no_{key}"))
        else:
            text = ",".join(map(str, value)) if isinstance(value, list) else str(value)
            words.append(f"{spelled(key)}={text}")
    return words


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    (tmp_path / "taken").mkdir()
    file = tmp_path / "cell.yaml"
    file.write_text(VALID, encoding="utf-8")
    return file


def test_there_are_a_hundred_wrong_files_and_no_two_are_alike() -> None:
    assert len({wrong.content for wrong in WRONG}) == len(WRONG) > 100


@pytest.mark.parametrize("wrong", WRONG, ids=lambda wrong: wrong.name)
def test_a_wrong_file_is_refused_with_its_line_before_a_move(wrong: Wrong, cell: Path) -> None:
    cell.write_bytes(wrong.content)
    before = sorted(cell.parent.rglob("*"))
    refused = winding(cell.parent, "run", "cell.yaml", code=2)
    assert re.match(f"winding: cell.yaml, line {wrong.line}, column [0-9]+: .", refused.stderr)
    assert wrong.words in refused.stderr
    assert refused.stderr.count("\n") == 1
    assert sorted(cell.parent.rglob("*")) == before


@pytest.mark.parametrize("wrong", random.Random(7).sample(WRONG, 12), ids=lambda wrong: wrong.name)
def test_check_refuses_what_a_run_refuses(wrong: Wrong, cell: Path) -> None:
    cell.write_bytes(wrong.content)
    refused, checked = (winding(cell.parent, *words, "cell.yaml") for words in (["run"], CHECKED))
    assert (checked.exit_code, checked.stderr) == (2, refused.stderr)


def test_an_editor_refuses_the_same_values() -> None:
    Draft202012Validator.check_schema(schema())
    assert CHECK.is_valid(yaml.safe_load(VALID))
    taken = [w.name for w in of_values() if CHECK.is_valid(yaml.safe_load(w.content))]
    # JSON has no such numbers.
    assert all("infinite" in name or "nan" in name for name in taken)


def test_file_options_and_goal_are_one_run(cell: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(cell.parent)
    filed = RunSpec.from_cell(cell, {})
    typed = RunSpec.from_cell(None, {**FLAT, "camera_position_mm": "430,1.5,52"}, spelled)
    assert filed == typed
    assert configured(filed, {}) == configured(typed, {})
    cell.write_text(filed.text(), encoding="utf-8")
    assert RunSpec.from_cell(cell, {}) == filed
    wanted = {key: value for key, value in FLAT.items() if key in GOAL_OPTIONS}
    assert set(FLAT) - set(wanted) == {"output", "compression", "namespace"}
    assert RunSpec.from_goal(wanted) == RunSpec.from_cell(None, wanted)


@pytest.mark.parametrize(
    "key", ["json", "truth", "program", "weights", "compose", "parameters", "domain", "dashboard"]
)
def test_a_goal_names_no_file_no_code_and_no_place(key: str) -> None:
    with pytest.raises(ParameterError, match=f"a goal has no parameter {key}"):
        RunSpec.from_goal({"case": 4, key: "x"})


def test_an_option_wins_over_the_file(cell: Path) -> None:
    spec = RunSpec.from_cell(
        cell, {"young_mpa": 2.2, "program": "a.csv", "camera_clock_correction": False}, spelled
    )
    assert spec.condition.young == 2.2e6
    assert not spec.camera.camera_clock_correction
    # One of two ways to say the same replaces the other.
    assert (spec.lay.program, spec.lay.pitch) == ("a.csv", 0.0)
    done = winding(cell.parent, "run", "cell.yaml", "--error-limit-pct", "-6")
    assert done.stderr == "winding: --error-limit-pct must be positive, got -6\n"
    done = winding(cell.parent, "run", "cell.yaml", "--turns", 4)
    assert done.stderr == "winding: --turns is for an external machine: see machine\n"


def test_a_new_cell_file_is_the_usual_run_and_each_of_its_comments_is_an_option(cell: Path) -> None:
    winding(cell.parent, "cell", "init", "new.yaml", code=0)
    again = winding(cell.parent, "cell", "init", "new.yaml")
    assert (again.exit_code, "exists already" in again.stderr) == (2, True)
    new = cell.parent / "new.yaml"
    assert RunSpec.from_cell(new, {}) == RunSpec.from_cell(None, {"case": 4})
    lines = template().splitlines()
    keys = {key: i for i, line in enumerate(lines) if (key := option_in(line)) and key != "case"}
    assert set(keys) == set(USUAL) - {"case"}
    for key, number in keys.items():
        with_it = [*lines[:number], lines[number].replace("# ", "", 1), *lines[number + 1 :]]
        new.write_text("\n".join(with_it), encoding="utf-8")
        beside = {"machine": "external"} if key == "turns" else {}
        assert key in RunSpec.from_cell(new, beside).given
        assert CHECK.is_valid(yaml.safe_load(new.read_text("utf-8")))


def option_in(line: str) -> str:
    found = re.match(r"  # (\w+): ", line)
    known = {key for declared in OPTIONS.values() for key in declared}
    return found[1] if found and found[1] in known else ""


def test_check_prints_what_the_file_means(cell: Path) -> None:
    shown = " ".join(winding(cell.parent, "cell", "check", "cell.yaml", code=0).stdout.split())
    for words in (
        "an own condition: cylinder", "young_mpa 3.1", "1.74 rad/s for 1.5 s",
        "simulated, its cable lies as fem; with a camera", "speed 0, seed 11", "frame_rate 1000",
        "wanted, control watch", "recorded nothing", f"written {cell.parent}/left", "lay_control",
    ):  # fmt: skip
        assert words in shown
    assert json.loads(winding(cell.parent, "cell", "schema").stdout) == schema()


def test_help_is_one_screen_and_the_whole_help_cuts_no_name(cell: Path) -> None:
    usual, whole = (
        winding(cell.parent, "run", option).stdout.splitlines()
        for option in ("--help", "--help-all")
    )
    assert len(usual) <= 42
    assert max(map(len, usual + whole)) <= 80
    assert "--help-all" in usual[-1]
    every = {key for declared in OPTIONS.values() for key in declared}
    for lines, keys in ((usual, set(USUAL)), (whole, every)):
        named = re.findall(r"^  --(?:\[no-\])?([a-z0-9-]+)", "\n".join(lines), re.MULTILINE)
        assert {name.replace("-", "_") for name in named} == keys


def test_no_text_ends_in_anything_but_a_refusal(cell: Path) -> None:
    chance = random.Random(20)
    for _ in range(300):
        data = bytearray(VALID.encode())
        for _ in range(chance.randint(1, 4)):
            at = chance.randrange(len(data))
            data[at : at + chance.randint(0, 9)] = chance.randbytes(chance.randint(0, 3))
        cell.write_bytes(data)
        with contextlib.suppress(ValueError):
            RunSpec.from_cell(cell, {})


@pytest.mark.processes
@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_run_of_a_file_leaves_the_numbers_of_its_options(cell: Path, command: Any) -> None:
    # What is recorded of a wanted lay differs from run to run with what the computer does beside.
    left_out = ("control", "pitch_mm", "lay_tolerance_mm", "error_limit_pct", "output")
    options = {key: value for key, value in FLAT.items() if key not in left_out}
    cell.write_text(RunSpec.from_cell(None, options).text(), encoding="utf-8")
    numbers = []
    for name, words in (("filed", ["cell.yaml"]), ("typed", words_of(options))):
        command("run", *words, "--output", name, cwd=cell.parent, code=0)
        numbers.append(json.loads((cell.parent / name / "run.json").read_text("utf-8")))
    filed, typed = ({**found, "identity": None, "wall_s": None} for found in numbers)
    assert filed == typed
    assert filed["joint_states"] == 1501
