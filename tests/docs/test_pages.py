"""What the pages name exists: links, commands, options, and the paper page's functions."""

import importlib
import importlib.util
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

from winding_cli.app import app

ROOT = Path(__file__).parents[2]
PAGES = sorted(
    path
    for path in (*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"))
    if not path.name.startswith(".")
)
DECISIONS = ROOT / "docs" / "decisions"
COMMAND: Any = typer.main.get_command(app)
# Tests of a node look into the node.
GUIDES = [
    *(page for page in (ROOT / "docs" / "tutorials").glob("*.md") if page.stem != "per-node-tests"),
    *(ROOT / "examples" / "gallery").glob("*.py"),
]
PAPER = (ROOT / "docs" / "paper.md").read_text("utf-8")
FUNCTION = r"`((?:winding_\w+|\w+_node)(?:\.\w+)+)`"
SHOWN_COMMAND = r"`((?:winding|python -m pytest) [^`]+)`"
PAPER_NAMES = sorted(set(re.findall(FUNCTION, PAPER)))
PAPER_COMMANDS = sorted(set(re.findall(SHOWN_COMMAND, PAPER)))
# Words that stand for those of another row.
REFERENCES = ("the same", "the same test")
ROWS = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in PAPER.split("## Sections")[0].splitlines()
    if re.match(r"\| (Table|Figure|Eq\.)", line)
]


def anchors(page: Path) -> set[str]:
    """Return the anchors of a page's headings, as GitHub makes them."""
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    titles = re.findall(r"^#+ (.*)$", text, flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


def commands(page: Path) -> Iterator[str]:
    """Yield every line of a page's code blocks that calls the project's command."""
    for block in re.findall(r"```(?:sh)?\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
        for line in block.replace("\\\n", " ").splitlines():
            words = line.strip().removeprefix("$ ").removeprefix(".venv/bin/").removeprefix("time ")
            if re.match(r"winding( |$)", words):
                yield words


def local_links(page: Path) -> list[str]:
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    targets = re.findall(r"\]\(([^)\s]+)\)", text)
    return [target for target in targets if not re.match(r"[a-z]+:", target)]


def broken_links(page: Path) -> Iterator[str]:
    for target in local_links(page):
        name, _, anchor = target.partition("#")
        path = (page.parent / name).resolve() if name else page
        if not path.exists() or (anchor and path.suffix == ".md" and anchor not in anchors(path)):
            yield f"{page.relative_to(ROOT)} links to {target}"


def unknown_words(line: str) -> list[str]:
    """Return the subcommands and options of a line that the command does not have."""
    words = shlex.split(line, comments=True)[1:]
    command = COMMAND
    while hasattr(command, "commands") and words and not words[0].startswith("-"):
        name = words.pop(0)
        if name == "COMMAND":
            return []
        if name not in command.commands:
            return [name]
        command = command.commands[name]
    known = {
        option
        for parameter in command.params
        for option in (*parameter.opts, *parameter.secondary_opts)
    } | {"--help"}
    return sorted({word.split("=")[0] for word in words if word.startswith("--")} - known)


def imported(page: Path) -> set[str]:
    """Return the packages of the project that a page's programs import."""
    names = set(re.findall(r"^(?:import|from) (\w+)", page.read_text(encoding="utf-8"), re.M))
    return {name for name in names if (ROOT / "ros2_ws" / "src" / name).is_dir()}


def test_guides_and_gallery_use_the_public_package_alone() -> None:
    used = {page.name: imported(page) for page in GUIDES}
    assert {name: names for name, names in used.items() if names - {"cable_winding"}} == {}
    assert sum(bool(names) for names in used.values()) >= 8


def test_links_lead_somewhere() -> None:
    assert sum(len(local_links(page)) for page in PAGES) > 100
    assert [link for page in PAGES for link in broken_links(page)] == []


def test_commands_have_the_options_that_the_pages_use() -> None:
    unknown = [
        f"{page.relative_to(ROOT)}: {word} in {line}"
        for page in PAGES
        for line in commands(page)
        for word in unknown_words(line)
    ]
    assert unknown == []


def test_every_decision_is_listed_with_its_title_and_status() -> None:
    listed = (DECISIONS / "README.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\d+) \| \[(.*)\]\((.*)\) \| (.*) \|$", listed, re.MULTILINE)
    pages = []
    for page in sorted(DECISIONS.glob("0*.md")):
        text = page.read_text(encoding="utf-8")
        title = re.match(r"# (\d+)\. (.*)", text)
        status = re.search(r"^Status: (.*)", text, re.MULTILINE)
        assert title, page.name
        assert status, page.name
        pages.append((title[1], title[2], page.name, status[1]))
    assert rows == pages


@pytest.mark.slow
def test_every_name_of_the_papers_page_can_be_imported() -> None:
    assert PAPER_NAMES
    assert [name for name in PAPER_NAMES if not _found(name)] == []


def test_every_command_of_the_papers_page_exists() -> None:
    assert PAPER_COMMANDS
    assert [line for line in PAPER_COMMANDS if not _exists(line)] == []


@pytest.mark.parametrize(("kind", "last"), [("Table", 8), ("Figure", 11), ("Eq.", 5)])
def test_everything_that_the_paper_numbers_is_mapped(kind: str, last: int) -> None:
    mapped: list[int] = []
    for row in ROWS:
        match = re.match(rf"{re.escape(kind)}s? (\d+)(?: (?:to|and) (\d+))?", row[0])
        if match:
            mapped += range(int(match[1]), int(match[2] or match[1]) + 1)
    assert mapped == list(range(1, last + 1))


def test_every_row_has_a_function_and_a_command() -> None:
    assert ROWS
    for row in ROWS:
        command = row[3] if row[0].startswith("Table") else row[2]
        assert re.search(FUNCTION, " ".join(row)), row
        assert re.search(SHOWN_COMMAND, command) or command.startswith(REFERENCES), row


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
    command = COMMAND.commands.get(words[1])
    if command is None:
        return False
    known = {option for parameter in command.params for option in parameter.opts}
    return {word for word in words[2:] if word.startswith("--")} <= known


def _is_module(name: str) -> bool:
    try:
        return importlib.util.find_spec(name) is not None
    except ModuleNotFoundError:
        return False
