"""What is public says what it takes, in which unit, what it holds, and how it refuses."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

from winding_cli.cli import app
from winding_core.parameters import declarations
from winding_ros import topics
from winding_ros.graph import GRAPH, parameters_of

SOURCE = Path(__file__).parents[2] / "ros2_ws" / "src"
FILES = sorted(path for path in SOURCE.glob("*/*/**/*.py") if "launch" not in path.parts)
Function = ast.FunctionDef | ast.AsyncFunctionDef

NUMBERS = re.compile(r"\bfloat\b|\w*Array\b|\bFloatOrArray\b|\bNDArray\b")
# A unit or a shape, or a word that says that there is none, or where it is said.
SAYS_UNIT = re.compile(
    r"\[[^\]]+\]|\([^)]*,[^)]*\)|\b(dimensionless|shape|shapes|share|factor|ratio|relative|"
    r"amplitude|probability|count|per|unit|bits|pixels?|colours?|grey|records|see)\b",
    re.IGNORECASE,
)
# Raised to be caught by the same room, or by whoever ends the command.
NOT_STATED = {"Exit", "NotImplementedError", "AssertionError"}


def identifier(path: Path) -> str:
    return str(path.relative_to(SOURCE))


def decorated(node: Function | ast.ClassDef, word: str) -> bool:
    return any(word in ast.unparse(item) for item in node.decorator_list)


def members(
    body: list[ast.stmt], inside: str = ""
) -> Iterator[tuple[str, ast.ClassDef | Function]]:
    """Yield what is public in a module or class, with its full name."""
    for node in body:
        if isinstance(node, ast.ClassDef | Function) and not node.name.startswith("_"):
            yield inside + node.name, node
            if isinstance(node, ast.ClassDef):
                yield from members(node.body, f"{inside}{node.name}.")


def own_statements(function: Function) -> Iterator[ast.AST]:
    """Yield the nodes of a function without those of functions inside it."""
    waiting: list[ast.AST] = list(function.body)
    while waiting:
        node = waiting.pop()
        if not isinstance(node, Function | ast.ClassDef | ast.Lambda):
            yield node
            waiting += ast.iter_child_nodes(node)


def raised(function: Function) -> set[str]:
    """Return the names of the exceptions that a function itself raises and does not catch."""
    names, caught = set(), ""
    for node in own_statements(function):
        if isinstance(node, ast.ExceptHandler) and node.type is not None:
            caught += ast.unparse(node.type)
        if isinstance(node, ast.Raise) and node.exc is not None:
            error = node.exc.func if isinstance(node.exc, ast.Call) else node.exc
            name = ast.unparse(error).split(".")[-1]
            if name[0].isupper():
                names.add(name)
    return {name for name in names - NOT_STATED if name not in caught}


def sections(docstring: str) -> dict[str, str]:
    """Return what a docstring says of each name of its Args section."""
    match = re.search(r"^Args:\n(.*?)(?=^\S|\Z)", docstring, re.MULTILINE | re.DOTALL)
    if match is None:
        return {}
    said = re.findall(r"^    (\w[\w, *]*):(.*?)(?=^    \w|\Z)", match[1], re.MULTILINE | re.DOTALL)
    return {name.strip(): words for names, words in said for name in names.split(",")}


def numbers_of(function: Function) -> list[str]:
    """Return the parameters that are floats or arrays."""
    inputs = [*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs]
    return [
        item.arg
        for item in inputs
        if item.annotation is not None
        and NUMBERS.search(ast.unparse(item.annotation))
        and "Callable" not in ast.unparse(item.annotation)
    ]


def undocumented_fields(node: ast.ClassDef, lines: list[str]) -> list[str]:
    """Return the public fields of a dataclass that nobody explains."""
    docstring = ast.get_docstring(node) or ""
    missing = []
    for field, after in zip(node.body, [*node.body[1:], None], strict=True):
        if not isinstance(field, ast.AnnAssign) or not isinstance(field.target, ast.Name):
            continue
        name = field.target.id
        statement = ast.unparse(field)
        told = (
            name.startswith("_")
            or re.search(rf"\b{name}\b", docstring)
            or re.search(r"parameter\(|help=", statement)
            or any("#" in line for line in lines[field.lineno - 1 : field.end_lineno])
            or (isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant))
        )
        if not told:
            missing.append(f"{node.name}.{name}")
    return missing


@pytest.mark.parametrize("path", FILES, ids=identifier)
def test_everything_public_has_a_docstring(path: Path) -> None:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    missing = [] if ast.get_docstring(tree) else ["the module"]
    for name, node in members(tree.body):
        if not ast.get_docstring(node) and not decorated(node, "overload"):
            missing.append(name)
    assert missing == []


@pytest.mark.parametrize("path", FILES, ids=identifier)
def test_every_field_of_a_record_is_explained(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    missing = [
        field
        for _, node in members(ast.parse(text).body)
        if isinstance(node, ast.ClassDef) and decorated(node, "dataclass")
        for field in undocumented_fields(node, text.splitlines())
    ]
    assert missing == []


@pytest.mark.parametrize("path", FILES, ids=identifier)
def test_every_refusal_is_stated(path: Path) -> None:
    missing = [
        f"{name} raises {error}"
        for name, node in members(ast.parse(path.read_text(encoding="utf-8")).body)
        if isinstance(node, Function)
        for error in sorted(raised(node))
        if error not in (ast.get_docstring(node) or "")
    ]
    assert missing == []


@pytest.mark.parametrize("path", FILES, ids=identifier)
def test_every_number_has_a_unit_or_a_shape(path: Path) -> None:
    """Where a docstring lists its arguments; one line of SI numbers needs no list."""
    missing = []
    for name, node in members(ast.parse(path.read_text(encoding="utf-8")).body):
        if isinstance(node, Function):
            said = sections(ast.get_docstring(node) or "")
            if said:
                missing += [
                    f"{name}: {number}"
                    for number in numbers_of(node)
                    if not SAYS_UNIT.search(said.get(number, ""))
                ]
    assert missing == []


@pytest.mark.parametrize(
    "path", [path for path in FILES if path.parent.name != "commands"], ids=identifier
)
def test_two_numbers_are_told_apart(path: Path) -> None:
    """A function of two numbers or more says a unit or a shape; commands have them in names."""
    missing = [
        name
        for name, node in members(ast.parse(path.read_text(encoding="utf-8")).body)
        if isinstance(node, Function)
        and not decorated(node, "overload")
        and len(numbers_of(node)) > 1
        and not SAYS_UNIT.search(ast.get_docstring(node) or "")
    ]
    assert missing == []


def commands(command: Any, name: str = "winding") -> Iterator[tuple[str, Any]]:
    """Yield every command of the command line with its full name."""
    if hasattr(command, "commands"):
        for inside, child in command.commands.items():
            yield from commands(child, f"{name} {inside}")
    else:
        yield name, command


@pytest.mark.parametrize(("name", "command"), list(commands(typer.main.get_command(app))), ids=str)
def test_every_command_explains_itself_and_its_options(name: str, command: Any) -> None:
    page = (SOURCE.parents[1] / "docs" / "commands.md").read_text(encoding="utf-8")
    assert command.help
    assert " ".join(name.split()[:2]) in page, "docs/commands.md lists every command"
    assert [item.name for item in command.params if not getattr(item, "help", "given")] == []


@pytest.mark.parametrize("spec", GRAPH, ids=lambda spec: spec.name)
def test_every_parameter_says_what_it_is_and_where_it_ends(spec: Any) -> None:
    for item in declarations(parameters_of(spec)):
        assert item.description, item.name
        if isinstance(item.default, float | list):
            assert item.low is not None or item.high is not None, item.name
            assert SAYS_UNIT.search(item.description), f"{item.name}: {item.description}"


@pytest.mark.parametrize("topic", topics.TOPICS, ids=lambda topic: topic.name)
def test_every_topic_says_what_it_carries(topic: topics.Topic) -> None:
    assert len(topic.description.split()) > 1
