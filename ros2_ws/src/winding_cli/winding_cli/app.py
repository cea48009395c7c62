"""The application `winding`: its commands by name, each imported when it is used."""

import ast
import importlib
from collections.abc import Iterator, Mapping
from importlib import resources
from importlib.metadata import EntryPoint, entry_points, version
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

# Commands of the product, in the order of the list of commands.
COMMANDS = (
    *("run", "cell", "cable", "serve", "predict", "plan", "sweep", "identify", "commission"),
    *("runs", "study", "train", "render", "track", "board", "play-film", "check-film"),
    *("calibrate", "conform", "doctor", "dashboard", "health", "graph", "bag"),
)
# Module of a command that does not have one of its own name.
_OF_CAMERA = ("render", "board", "calibrate", "play-film", "check-film")
_MODULES = {"health": "graph", **dict.fromkeys(_OF_CAMERA, "camera")}


def summary(name: str) -> str:
    """Return the first paragraph of a command's help, as its module states it."""
    module = resources.files(f"{__package__}.commands") / f"{_module(name)}.py"
    tree = ast.parse(module.read_text(encoding="utf-8"))
    for item in tree.body:
        if isinstance(item, ast.FunctionDef) and item.name == name.replace("-", "_"):
            return (ast.get_docstring(item) or "").split("\n\n")[0]
    return _group_help(ast.get_docstring(tree))


def _module(name: str) -> str:
    return _MODULES.get(name, name)


def _group_help(docstring: str | None) -> str:
    """Return the help of a group: its module's docstring behind the command's name."""
    text = (docstring or "").partition(": ")[2]
    return text[:1].upper() + text[1:]


def _installed() -> dict[str, EntryPoint]:
    """Return the commands that other packages bring, by name."""
    return {point.name: point for point in entry_points(group="winding.commands")}


class _LazyCommands(Mapping[str, Any]):
    """Commands by name, imported on access."""

    def __getitem__(self, name: str) -> Any:
        if name in COMMANDS:
            module = f"winding_cli.commands.{_module(name)}"
            command = getattr(importlib.import_module(module), name.replace("-", "_"))
        else:
            command = _installed()[name].load()
        if not isinstance(command, typer.Typer):
            alone = typer.Typer(pretty_exceptions_enable=False, add_completion=False)
            alone.command()(command)
            command = alone
        return typer.main.get_command(command)

    def __iter__(self) -> Iterator[str]:
        return iter((*COMMANDS, *_installed()))

    def __len__(self) -> int:
        return len(COMMANDS) + len(_installed())


class _LazyGroup(TyperGroup):
    """Lists its commands without importing them."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.commands = _LazyCommands()  # type: ignore[assignment]

    def list_commands(self, ctx: Any) -> list[str]:
        return list(self.commands)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        late = self.commands
        self.commands = {name: TyperCommand(name, help=summary(name)) for name in COMMANDS}
        self.commands.update({name: late[name] for name in _installed()})
        try:
            super().format_help(ctx, formatter)
        finally:
            self.commands = late


def command_group(docstring: str | None) -> typer.Typer:
    """Return the command of a module that consists of several, without any yet."""
    return typer.Typer(
        help=_group_help(docstring),
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        add_completion=False,
    )


app = typer.Typer(
    cls=_LazyGroup,
    help="Predicts, watches and corrects how a flexible cable lays itself on a cylinder.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"winding {version('cable-winding-twin')}")
        raise typer.Exit


@app.callback()
def _begin(
    shown: Annotated[
        bool,
        typer.Option(
            "--version", help="Show the version and end.", callback=_print_version, is_eager=True
        ),
    ] = False,
) -> None:
    pass
