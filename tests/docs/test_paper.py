"""The page about the paper names functions and commands that exist, and leaves nothing out."""

from __future__ import annotations

import importlib
import importlib.util
import re
import shlex
from pathlib import Path
from typing import Any

import pytest
import typer

from winding_cli.app import app

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "paper.md").read_text("utf-8")
FUNCTION = r"`((?:winding_\w+|\w+_node)(?:\.\w+)+)`"
COMMAND = r"`((?:winding|python -m pytest) [^`]+)`"
NAMES = sorted(set(re.findall(FUNCTION, PAGE)))
COMMANDS = sorted(set(re.findall(COMMAND, PAGE)))
# Words that stand for those of another row.
REFERENCES = ("the same", "the same test")
ROWS = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in PAGE.split("## Sections")[0].splitlines()
    if re.match(r"\| (Table|Figure|Eq\.)", line)
]


def test_every_name_of_the_page_can_be_imported() -> None:
    assert [name for name in NAMES if not _found(name)] == []


def test_every_command_of_the_page_exists() -> None:
    assert [line for line in COMMANDS if not _exists(line)] == []


@pytest.mark.parametrize(("kind", "last"), [("Table", 8), ("Figure", 11), ("Eq.", 5)])
def test_everything_that_the_paper_numbers_is_mapped(kind: str, last: int) -> None:
    mapped: list[int] = []
    for row in ROWS:
        match = re.match(rf"{re.escape(kind)}s? (\d+)(?: (?:to|and) (\d+))?", row[0])
        if match:
            mapped += range(int(match[1]), int(match[2] or match[1]) + 1)
    assert mapped == list(range(1, last + 1))


def test_every_row_has_a_function_and_a_command() -> None:
    for row in ROWS:
        command = row[3] if row[0].startswith("Table") else row[2]
        assert re.search(FUNCTION, " ".join(row)), row
        assert re.search(COMMAND, command) or command.startswith(REFERENCES), row


def _found(name: str) -> bool:
    parts = name.split(".")
    depth = max(i for i in range(1, len(parts)) if _is_module(".".join(parts[:i])))
    thing: Any = importlib.import_module(".".join(parts[:depth]))
    for part in parts[depth:]:
        if not hasattr(thing, part):
            return False
        thing = getattr(thing, part)
    return True


def _exists(line: str) -> bool:
    words = shlex.split(line)
    if words[0] == "python":
        return (ROOT / words[-1]).is_file()
    command: Any = typer.main.get_command(app)
    command = command.commands.get(words[1])
    if command is None:
        return False
    known = {option for parameter in command.params for option in parameter.opts}
    return {word for word in words[2:] if word.startswith("--")} <= known


def _is_module(name: str) -> bool:
    try:
        return importlib.util.find_spec(name) is not None
    except ModuleNotFoundError:
        return False
