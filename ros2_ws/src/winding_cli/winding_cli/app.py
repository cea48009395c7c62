"""The application `winding`: its commands by name, each imported when it is used."""

import importlib
from collections.abc import Iterator, Mapping
from importlib.metadata import EntryPoint, entry_points, version
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

# Command of the product -> first paragraph of its help, in the order of the list of commands.
SUMMARIES = {
    "run": "Wind one case: predict, measure, correct; end with a table and a report.",
    "cell": "Write, check and describe cell files, which `winding run` takes.",
    "cable": "List, show and compare the cables of the library, and add your own.",
    "serve": "Serve run/send_goal, run/cancel_goal and run/get_result until Ctrl-C.",
    "predict": (
        "Predict where every marker ends up, how much cable is used, and how far to trust it."
    ),
    "plan": (
        "Plan the machine's motion that lays a program, and report what is out of reach, and why."
    ),
    "sweep": "Wind every combination of parameters that a file describes and tabulate the results.",
    "identify": (
        "Identify the cable's material from tracked markers by inverse winding, or from a test."
    ),
    "commission": (
        "Wind one run that is chosen for what it tells, and write the cell and the cable found."
    ),
    "runs": "List, show and compare the runs of a folder, and report what drifts over them.",
    "study": "Compute Tables 2 to 8 beside the paper's, every measured marker, and compare models.",
    "train": (
        "Learn the correction factor h and compare it, in-sample and by case left out, with others."
    ),
    "render": "Render the measured lay of a case: frames, motion.csv, truth.csv, camera.yaml.",
    "track": "Track a recording and print where every marker lies.",
    "board": "Draw the board that `winding calibrate` looks for; print it at its true size.",
    "play-film": (
        "Publish a film as a camera's driver does: frames with their stamps and their rhythm."
    ),
    "check-film": (
        "Judge exposure, gain and light by the pictures; exit 1 where something is to be changed."
    ),
    "calibrate": "Fit camera matrix and distortion, and write the YAML that ROS tools read.",
    "conform": "Listen to a running driver and report, promise by promise, what it keeps.",
    "doctor": "Check Python, wheels, discovery, domain, clocks, disk; exit 1 on a FAIL.",
    "dashboard": "Serve the operator's page; Ctrl-C ends it.",
    "health": "Listen to /diagnostics; exit 1 when a node is silent or in error.",
    "graph": "Show the nodes, their topics and who listens.",
    "bag": "Look into recordings, check, recover, play, replay and export them.",
}

# Module of a command that does not have one of its own name.
_OF_CAMERA = ("render", "board", "calibrate", "play-film", "check-film")
_MODULES = {"health": "graph", **dict.fromkeys(_OF_CAMERA, "camera")}


def _installed() -> dict[str, EntryPoint]:
    """Return the commands that other packages bring, by name."""
    return {point.name: point for point in entry_points(group="winding.commands")}


class _LazyCommands(Mapping[str, Any]):
    """Commands by name, imported on access."""

    def __getitem__(self, name: str) -> Any:
        if name in SUMMARIES:
            module = f"winding_cli.commands.{_MODULES.get(name, name)}"
            command = getattr(importlib.import_module(module), name.replace("-", "_"))
        else:
            command = _installed()[name].load()
        if not isinstance(command, typer.Typer):
            alone = typer.Typer(pretty_exceptions_enable=False, add_completion=False)
            alone.command()(command)
            command = alone
        return typer.main.get_command(command)

    def __iter__(self) -> Iterator[str]:
        return iter((*SUMMARIES, *_installed()))

    def __len__(self) -> int:
        return len(SUMMARIES) + len(_installed())


class _LazyGroup(TyperGroup):
    """Lists its commands without importing them."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.commands = _LazyCommands()  # type: ignore[assignment]

    def list_commands(self, ctx: Any) -> list[str]:
        return list(self.commands)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        late = self.commands
        self.commands = {name: TyperCommand(name, help=text) for name, text in SUMMARIES.items()}
        self.commands.update({name: late[name] for name in _installed()})
        try:
            super().format_help(ctx, formatter)
        finally:
            self.commands = late


def command_group(name: str) -> typer.Typer:
    """Return the command of a name that consists of several, without any yet."""
    return typer.Typer(
        help=SUMMARIES[name],
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
