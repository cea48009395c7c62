"""What is public documents its arguments with units, its fields and its errors.

That it has a docstring at all is ruff's to say.
"""

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer

from winding_cli.app import app
from winding_core.parameters import declarations
from winding_ros import topics
from winding_ros.graph import GRAPH, parameters_of

SOURCE = Path(__file__).parents[2] / "ros2_ws" / "src"
FILES = sorted(path for path in SOURCE.glob("*/*/**/*.py") if "launch" not in path.parts)
TEXTS = {path: path.read_text(encoding="utf-8") for path in FILES}
TREES = {path: ast.parse(text) for path, text in TEXTS.items()}
Function = ast.FunctionDef | ast.AsyncFunctionDef

NUMBERS = re.compile(r"\bfloat\b|\w*Array\b|\bFloatOrArray\b|\bNDArray\b")
# A unit or a shape, or a word that marks it as dimensionless, or refers to where it stands.
UNIT = re.compile(
    r"\[[^\]]+\]|\([^)]*,[^)]*\)|\b(dimensionless|shape|shapes|share|factor|ratio|relative|"
    r"amplitude|probability|count|per|unit|bits|pixels?|colours?|grey|records|see)\b",
    re.IGNORECASE,
)
# Raised to be caught by the same room, or by whoever ends the command.
NOT_STATED = {"Exit", "NotImplementedError", "AssertionError"}


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
    """Return the text of each name of its Args section."""
    match = re.search(r"^Args:\n(.*?)(?=^\S|\Z)", docstring, re.MULTILINE | re.DOTALL)
    if match is None:
        return {}
    found = re.findall(r"^    (\w[\w, *]*):(.*?)(?=^    \w|\Z)", match[1], re.MULTILINE | re.DOTALL)
    return {name.strip(): words for names, words in found for name in names.split(",")}


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
    """Return the public fields of a dataclass that are not explained."""
    docstring = ast.get_docstring(node) or ""
    missing = []
    for field, after in zip(node.body, [*node.body[1:], None], strict=True):
        if not isinstance(field, ast.AnnAssign) or not isinstance(field.target, ast.Name):
            continue
        name = field.target.id
        statement = ast.unparse(field)
        explained = (
            name.startswith("_")
            or re.search(rf"\b{name}\b", docstring)
            or re.search(r"parameter\(|help=", statement)
            or any("#" in line for line in lines[field.lineno - 1 : field.end_lineno])
            # What does not fit beside a field stands in the line above it.
            or lines[field.lineno - 2].strip().startswith("# ")
            or (isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant))
        )
        if not explained:
            missing.append(f"{node.name}.{name}")
    return missing


def public() -> Iterator[tuple[Path, str, ast.ClassDef | Function]]:
    """Yield everything public of all files, with the place to name it by."""
    for path in FILES:
        for name, node in members(TREES[path].body):
            yield path, f"{path.relative_to(SOURCE)}: {name}", node


def functions() -> Iterator[tuple[Path, str, Function]]:
    for path, name, node in public():
        if isinstance(node, Function):
            yield path, name, node


def test_every_field_of_a_record_is_explained() -> None:
    missing = [
        f"{path.relative_to(SOURCE)}: {field}"
        for path, _, node in public()
        if isinstance(node, ast.ClassDef) and decorated(node, "dataclass")
        for field in undocumented_fields(node, TEXTS[path].splitlines())
    ]
    assert missing == []


def test_every_refusal_is_stated() -> None:
    missing = [
        f"{name} raises {error}"
        for _, name, node in functions()
        for error in sorted(raised(node))
        if error not in (ast.get_docstring(node) or "")
    ]
    assert missing == []


def test_every_number_has_a_unit_or_a_shape() -> None:
    """Where a docstring lists its arguments; one line of SI numbers needs no list."""
    missing = [
        f"{name}: {number}"
        for _, name, node in functions()
        if (found := sections(ast.get_docstring(node) or ""))
        for number in numbers_of(node)
        if not UNIT.search(found.get(number, ""))
    ]
    assert missing == []


def test_functions_of_two_numbers_state_units_or_shapes() -> None:
    """A function of two numbers or more states a unit or a shape; commands have them in names."""
    missing = [
        name
        for path, name, node in functions()
        if path.parent.name != "commands"
        and not decorated(node, "overload")
        and len(numbers_of(node)) > 1
        and not UNIT.search(ast.get_docstring(node) or "")
    ]
    assert missing == []


def commands(command: Any, name: str = "winding") -> Iterator[tuple[str, Any]]:
    """Yield every command of the command line with its full name."""
    if hasattr(command, "commands"):
        for inside, child in command.commands.items():
            yield from commands(child, f"{name} {inside}")
    else:
        yield name, command


def test_every_command_explains_itself_and_its_options() -> None:
    page = (SOURCE.parents[1] / "docs" / "commands.md").read_text(encoding="utf-8")
    found = list(commands(typer.main.get_command(app)))
    assert found
    for name, command in found:
        assert command.help, name
        assert " ".join(name.split()[:2]) in page, f"docs/commands.md does not list {name}"
        unexplained = [item.name for item in command.params if not getattr(item, "help", "given")]
        assert unexplained == [], name


def test_every_parameter_has_a_description_a_unit_and_a_range() -> None:
    declared = [
        (f"{spec.name}: {item.name}", item)
        for spec in GRAPH
        for item in declarations(parameters_of(spec))
    ]
    assert [name for name, item in declared if not item.description] == []
    numbers = [(name, item) for name, item in declared if isinstance(item.default, float | list)]
    assert numbers
    assert [name for name, item in numbers if item.low is None and item.high is None] == []
    assert [name for name, item in numbers if not UNIT.search(item.description)] == []


def test_every_topic_is_described() -> None:
    assert [topic.name for topic in topics.TOPICS if len(topic.description.split()) < 2] == []
