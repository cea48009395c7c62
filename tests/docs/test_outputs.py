"""What the pages show as output is what the command prints, uncut; numbers agree."""

import ast
import io
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path

import pytest
from rich.table import Table
from script import script

from correction_node.models.dataset import load_data_set
from correction_node.models.weights import SHIPPED
from correction_node.training.comparison import compare_models
from winding_cli.terminal.console import result_console
from winding_core.cable.material_law import LAWS

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
FOLDER = Path(__file__).parents[2] / "ros2_ws" / "src"
COMMANDS = sorted([*FOLDER.glob("winding_cli/*/**/*.py"), *FOLDER.glob("*/*/commands/**/*.py")])
WIDE = "a column of seventy characters " * 2 + "12345678"


WRITER = script(DOCS / "outputs.py")
OUTPUTS = sorted(WRITER.outputs(), key=lambda output: (output.file, output.start))


def table(page: str, after: str) -> dict[str, list[str]]:
    """Return the cells of the first table behind a text, by the first cell of each row."""
    text = (DOCS / page).read_text(encoding="utf-8").split(after, 1)[1]
    rows = re.search(r"(?:^\|.*\|\n)+", text, re.MULTILINE)
    cells = [[cell.strip() for cell in row.strip("|").split("|")] for row in rows[0].splitlines()]
    return {first: rest for first, *rest in cells[2:]}


def card(name: str) -> dict[str, dict[str, float]]:
    text = (files("correction_node") / "trained" / name / "card.json").read_text(encoding="utf-8")
    errors: dict[str, dict[str, float]] = json.loads(text)["errors"]
    return errors


def numbers(cell: str) -> list[float]:
    return [float(number) for number in re.findall(r"\d+\.\d+", cell)]


@pytest.mark.slow
@pytest.mark.parametrize("output", OUTPUTS, ids=lambda output: output.command[:60])
def test_a_page_shows_what_the_command_prints(output: object) -> None:
    assert output.printed() == output.shown, "run `python docs/outputs.py`"  # type: ignore[attr-defined]


def test_outputs_of_the_tutorials_the_graph_and_the_interfaces_are_marked() -> None:
    marked = {output.file.name for output in OUTPUTS}
    assert {"README.md", "first-run.md", "your-own-cable.md", "interfaces.md"} <= marked


def test_a_stale_output_is_written_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = WRITER
    page = tmp_path / "page.md"
    page.write_text(
        "<!-- output of: echo one -->\n```\nold\n```\n\n"
        "<!-- output of: echo two -->\n\n| old |\n\n<!-- end of output -->\n",
        encoding="utf-8",
    )
    monkeypatch.setattr(module, "PAGES", (page,))
    monkeypatch.setattr(module, "ROOT", tmp_path)
    monkeypatch.setattr(
        module, "outputs", lambda own=module.outputs: (o for o in own() if o.file == page)
    )
    monkeypatch.setattr(sys, "argv", ["outputs.py", "--check"])
    assert module.main() == 1
    monkeypatch.setattr(sys, "argv", ["outputs.py"])
    assert module.main() == 0
    assert page.read_text(encoding="utf-8") == (
        "<!-- output of: echo one -->\n```\none\n```\n\n"
        "<!-- output of: echo two -->\n\ntwo\n\n<!-- end of output -->\n"
    )
    assert module.main() == 0


def test_a_command_that_fails_is_no_output() -> None:
    output = WRITER.Output(file=DOCS, command="false | cat", shown="", start=0)
    with pytest.raises(subprocess.CalledProcessError):
        output.printed()


def test_errors_of_what_ships_are_those_of_its_cards() -> None:
    shown = table("learning.md", "## What ships")
    assert {name.split("`")[1] for name in shown} == set(SHIPPED)
    for name, (_, model, error) in shown.items():
        errors = card(name.split("`")[1])[model]
        assert numbers(error) == [pytest.approx(errors["leave_one_case_out_pct"], abs=0.0051)]


@pytest.mark.parametrize(
    ("page", "name"), [("learning.md", "rod"), ("measurements/correction.md", "paper")]
)
def test_errors_of_the_baselines_are_those_of_the_cards(page: str, name: str) -> None:
    shown = table(page, f"--data {name}`")
    errors = card(name)
    known = shown.keys() & errors.keys() - {model for _, model in SHIPPED.values()}
    assert len(known) >= 4
    for rival in known:
        in_sample, left_out, worst, _ = (numbers(cell)[0] for cell in shown[rival])
        assert in_sample == pytest.approx(errors[rival]["in_sample_pct"], abs=0.0051), rival
        assert left_out == pytest.approx(errors[rival]["leave_one_case_out_pct"], abs=0.0051)
        assert worst == pytest.approx(errors[rival]["worst_case_left_out_pct"], abs=0.0051)


def test_the_paper_s_network_has_the_same_errors_on_every_page() -> None:
    beside = table("paper.md", "After a correction factor h")["the paper's form of network, ours"]
    rod = table("learning.md", "--data rod`")["network"]
    paper = table("measurements/correction.md", "--data paper`")["network"]
    assert [numbers(cell) for cell in beside] == [numbers(cell) for cell in (*rod[:2], *paper[:2])]


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("page", "data"), [("learning.md", "rod"), ("measurements/correction.md", "paper")]
)
def test_errors_of_every_model_are_those_of_a_training(page: str, data: str) -> None:
    scores = compare_models(load_data_set(data), steps=1500, progress=lambda _: None)
    shown = table(page, f"--data {data}`")
    compared = 0
    for name, score in scores.items():
        cells = shown.get(name)
        if cells is None:
            continue
        compared += 1
        # Sums in another order move a network by a hundredth.
        in_sample, left_out = (numbers(cell)[0] for cell in cells[:2])
        assert in_sample == pytest.approx(score.in_sample_pct, abs=0.02), name
        assert left_out == pytest.approx(score.leave_one_case_out_pct, abs=0.02), name
    assert compared >= 6


def test_the_solver_s_page_counts_the_laws() -> None:
    words = {4: "four", 5: "five", 6: "six"}
    assert f"{words[len(LAWS)]} material laws" in (DOCS / "solver.md").read_text(encoding="utf-8")


def test_a_table_of_150_columns_is_whole_in_a_pipe(monkeypatch: pytest.MonkeyPatch) -> None:
    pipe = io.StringIO()
    monkeypatch.setattr("sys.stdout", pipe)
    result_console().print(Table(WIDE, WIDE.upper()))
    assert f"{WIDE} ┃ {WIDE.upper()}" in pipe.getvalue()


def test_results_go_to_the_one_console() -> None:
    made = [
        f"{path.name}:{node.lineno}"
        for path in COMMANDS
        if path.stem != "console"
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call)
        and getattr(node.func, "id", "") == "Console"
        # Progress goes to the other stream.
        and "stderr" not in {word.arg for word in node.keywords}
    ]
    assert len(COMMANDS) > 20
    assert made == []


def test_no_unit_is_swallowed_as_markup() -> None:
    # Rich takes "[rad]" for a style of that name and prints nothing.
    swallowed = [
        f"{path.name}: {words}"
        for path in COMMANDS
        for words in printed(ast.parse(path.read_text(encoding="utf-8")))
        if re.search(r"\[(rad|m|mm|s|kg|g|k?Pa|mrad)\b", words)
    ]
    assert swallowed == []


def printed(tree: ast.Module) -> Iterator[str]:
    """Yield the texts of a module that are no docstrings."""
    docstrings = {
        ast.get_docstring(node, clean=False)
        for node in ast.walk(tree)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef)
    }
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.Constant)
            and isinstance(node.value, str)
            and node.value not in docstrings
        ):
            yield node.value
