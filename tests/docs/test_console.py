"""What a command prints is not cut where there is no terminal to tell a width."""

import ast
import io
import re
from pathlib import Path

import pytest
from rich.table import Table

from winding_cli.commands.console import result_console

COMMANDS = Path(__file__).parents[2] / "ros2_ws/src/winding_cli/winding_cli/commands"
WIDE = "a column of seventy characters " * 2 + "12345678"


def test_a_table_of_a_hundred_and_fifty_columns_is_whole_in_a_pipe(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pipe = io.StringIO()
    monkeypatch.setattr("sys.stdout", pipe)
    result_console().print(Table(WIDE, WIDE.upper()))
    assert f"{WIDE} ┃ {WIDE.upper()}" in pipe.getvalue()


@pytest.mark.parametrize("path", sorted(COMMANDS.glob("*.py")), ids=lambda path: path.stem)
def test_results_go_to_the_one_console(path: Path) -> None:
    made = [
        node
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Console"
    ]
    progress = [call for call in made if "stderr" in {word.arg for word in call.keywords}]
    assert path.stem == "console" or made == progress


@pytest.mark.parametrize("path", sorted(COMMANDS.glob("*.py")), ids=lambda path: path.stem)
def test_no_unit_is_swallowed_as_markup(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    docstrings = {
        ast.get_docstring(node, clean=False)
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
    }
    printed = [
        node.value
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and node.value not in docstrings
    ]
    # Rich takes "[rad]" for a style of that name and prints nothing.
    assert [
        words for words in printed if re.search(r"\[(rad|m|mm|s|kg|g|k?Pa|mrad)\b", words)
    ] == []
