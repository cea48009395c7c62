"""What a command prints is not cut where there is no terminal to tell a width."""

import ast
import io
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from rich.table import Table

from winding_cli.terminal.console import result_console

FOLDER = Path(__file__).parents[2] / "ros2_ws" / "src"
COMMANDS = sorted([*FOLDER.glob("winding_cli/*/**/*.py"), *FOLDER.glob("*/*/commands/**/*.py")])
WIDE = "a column of seventy characters " * 2 + "12345678"


def test_a_table_of_a_hundred_and_fifty_columns_is_whole_in_a_pipe(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
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
